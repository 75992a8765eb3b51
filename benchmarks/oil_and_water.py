"""Two liquids in one scene against SPlisHSPlasH, and the reference against itself from starts 1 mm aside (the floor).

    python benchmarks/oil_and_water.py [--frames 300]

Two scenes: a box of oil is released under water, and a block of water falls on oil. The Chamfer distance is that of
each liquid by itself, mean over both liquids and all frames, so that liquids at each other's place count.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable

import numpy as np

from record import write_result
from surfsup.datasets.generation.floor import AXES, shift_along, shifted_particles
from surfsup.evaluation.metrics import chamfer
from surfsup.scene import Block, Container, Fluid, InitialParticles, Liquid, Scene
from surfsup.simulation import Simulation
from surfsup.splishsplash import solver

OIL, WATER = Liquid(viscosity=0.01, density=911), Liquid(viscosity=0.01)
TANK = Container(size=(0.56, 0.56, 1.0))
SCENES = {
    "oil released under water": [
        Fluid(block=Block((-0.12, -0.12, 0.06), (0.12, 0.12, 0.24)), liquid=OIL),
        Fluid(block=Block((-0.24, -0.24, 0.02), (0.24, 0.24, 0.44)), liquid=WATER),
    ],
    "water falls on oil": [
        Fluid(block=Block((-0.24, -0.24, 0.02), (0.24, 0.24, 0.23)), liquid=OIL),
        Fluid(block=Block((-0.15, -0.1, 0.45), (0.1, 0.1, 0.7), velocity=(0, 0, -1)), liquid=WATER),
    ],
}


def distances(found: Iterable[np.ndarray], expected: list[np.ndarray], liquids: np.ndarray) -> np.ndarray:
    """Chamfer distance (frames, liquids) of positions (N, 3) in each frame, meters."""
    numbers = range(liquids.max() + 1)
    pairs = zip(found, expected, strict=True)
    return np.array([[chamfer(a[liquids == k], b[liquids == k]).plain for k in numbers] for a, b in pairs])


def reference(scene: Scene, start: InitialParticles) -> list[np.ndarray]:
    """The positions of each frame by SPlisHSPlasH."""
    return [positions for positions, _ in solver.simulate(scene, None, start)]


def main() -> None:
    """Run both scenes, print and write the distances."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=300)
    frames = parser.parse_args().frames
    scenes: dict[str, dict[str, float]] = {}
    for name, fluid in SCENES.items():
        scene = Scene(container=TANK, fluid=fluid, frames=frames)
        simulation = Simulation(scene)
        start, liquids = simulation.particles, simulation.particles.liquids
        assert liquids is not None
        expected = reference(scene, start)
        ours = distances((frame.positions for frame in simulation.run()), expected, liquids)
        repeats = (reference(scene, shifted_particles(start, shift_along(scene, axis))) for axis in range(AXES))
        floor = np.mean([distances(run, expected, liquids) for run in repeats], axis=0)
        scenes[name] = {
            "particles": len(liquids),
            "chamfer": round(float(ours.mean()), 5),
            "floor": round(float(floor.mean()), 5),
            "frame_100": round(float(ours[100].mean() / floor[100].mean()), 3),
        }
        print(name, scenes[name], f"ratio {ours.mean() / floor.mean():.3f}", flush=True)
    figure, peer = (float(np.mean([scene[key] for scene in scenes.values()])) for key in ("chamfer", "floor"))
    write_result(
        "oil_and_water",
        f"Chamfer distance to the reference of each liquid, mean over {len(scenes)} scenes of oil and water, "
        f"{frames} frames",
        round(figure, 4),
        "m",
        "floor: SPlisHSPlasH from a start 1 mm aside",
        round(peer, 4),
        f"python benchmarks/oil_and_water.py --frames {frames}",
        values={"scenes": scenes, "ratio": round(figure / peer, 3)},
        threads=1,
    )


if __name__ == "__main__":
    main()
