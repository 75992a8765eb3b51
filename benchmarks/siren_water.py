"""Water on a SIREN beside water on the mesh that it was fitted to, both compared with the reference on the mesh.

    python benchmarks/siren_water.py dragon.safetensors dragon.obj [--up y] [--frames 400] [--turns 0 120 240]
        [--simulator NAME] [-o FOLDER]

For each rotation of the solid about z, SPlisHSPlasH simulates the reference, and the simulator four rollouts: on the
mesh, on the SIREN, and on both with the water 1 mm aside, which shows how much of a difference is chance. Chamfer
distances are means over all frames, in meters. Particles inside are counted by the exact distance to the mesh and
summed over the frames. References stay in FOLDER and are not simulated again.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np
import torch

from surfsup.evaluation.evaluate import evaluate_trajectory
from surfsup.evaluation.scores import ALL
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.learned.loading import load_simulator
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import Container, InitialParticles, Scene
from surfsup.scene.fluid import Block
from surfsup.scene.from_surface import Placement, scene_from_surface
from surfsup.simulation import Simulation
from surfsup.sph.simulator import Simulator
from surfsup.splishsplash import solver

FIT = 0.7  # meters: largest extent of the solid
BLOCK = Block(min=(-0.225, -0.225, 0.65), max=(0.225, 0.225, 1.1))
OFFSET = 1e-3  # meters


def scene_of(path: Path, up: str | None, turn: float, frames: int) -> Scene:
    """The same block of water over the solid in ``path``, turned by ``turn`` degrees about z."""
    return scene_from_surface(path, Placement(FIT, up, turn), Container(), BLOCK, frames)[0]


def write_reference(path: Path, scene: Scene, start: InitialParticles) -> None:
    """Simulate ``scene`` with SPlisHSPlasH; the file appears only when it is complete."""
    partial = path.with_suffix(".partial")
    frames = solver.simulate(scene, scene.build_surface(), start)
    with TrajectoryWriter(partial, scene, Provenance(solver.NAME), len(start.positions)) as writer:
        for frame in frames:
            writer.append(*frame)
    partial.replace(path)


def write_rollout(path: Path, simulator: Simulator, scene: Scene, start: InitialParticles, offset: float) -> None:
    """Simulate ``scene`` with its water moved by ``offset`` along x."""
    moved = InitialParticles(
        [block + np.float32([offset, 0, 0]) for block in start.block_positions], start.block_velocities, start.excluded
    )
    with TrajectoryWriter(path, scene, Provenance("simulator"), len(start.positions)) as writer:
        for frame in Simulation(scene, simulator, "cpu", particles=moved).run():
            writer.append(frame.positions, frame.velocities)


def main() -> None:
    """Print a line for each rotation and solid, then the ratio of the means."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("siren", type=Path)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--up", choices=("y", "z"))
    parser.add_argument("--frames", type=int, default=400)
    parser.add_argument("--turns", type=float, nargs="+", default=[0.0, 120.0, 240.0])
    parser.add_argument("--simulator", default=DEFAULT_SIMULATOR, help="name or weights file")
    parser.add_argument("-o", "--out", type=Path, default=Path("out/siren-water"))
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    arguments.out.mkdir(parents=True, exist_ok=True)
    simulator, _ = load_simulator(arguments.simulator)
    found: dict[str, list[float]] = {}
    for turn in arguments.turns:
        name = f"{arguments.mesh.stem}-{turn:g}-{arguments.frames}"
        mesh_scene = scene_of(arguments.mesh, arguments.up, turn, arguments.frames)
        start = mesh_scene.initial_particles(mesh_scene.build_surface())
        reference = arguments.out / f"{name}-reference.h5"
        if not reference.exists():
            write_reference(reference, mesh_scene, start)
        scenes = {"mesh": mesh_scene, "SIREN": scene_of(arguments.siren, None, turn, arguments.frames)}
        for offset in (0.0, OFFSET):
            for solid, scene in scenes.items():
                rollout = arguments.out / f"{name}-{solid.lower()}{'-aside' if offset else ''}.h5"
                write_rollout(rollout, simulator, scene, start, offset)
                evaluation = evaluate_trajectory(rollout, reference)
                chamfer = evaluation.scores[ALL]["chamfer"]
                found.setdefault(solid, []).append(chamfer)
                inside, depth = int(evaluation.comparison.prediction.inside.sum()), evaluation.scores[ALL]["depth"]
                print(
                    f"turned by {turn:g} degrees, on the {solid}{', 1 mm aside' if offset else ''}: Chamfer "
                    f"{chamfer:.4f} m, inside {inside} of {evaluation.particles * arguments.frames}, "
                    f"{-1000 * (depth or 0):.2f} mm deep in the mean",
                    flush=True,
                )
    mesh, siren = (np.array(found[solid]) for solid in ("mesh", "SIREN"))
    print(f"means {mesh.mean():.4f} and {siren.mean():.4f} m: ratio {siren.mean() / mesh.mean():.3f}")
    print(f"single runs: SIREN over mesh {', '.join(f'{ratio:.3f}' for ratio in siren / mesh)}")
    chance = mesh[1::2] / mesh[::2]
    print(f"mesh, 1 mm aside over not: {', '.join(f'{ratio:.3f}' for ratio in chance)}")


if __name__ == "__main__":
    main()
