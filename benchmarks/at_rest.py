"""A pool at rest: height, speed and density over 2,000 frames, beside SPlisHSPlasH.

    python benchmarks/at_rest.py [--simulator NAME] [--frames 2001] [--side 0.6] [--depth 0.3] [--solver]

Water covers the floor of a container from wall to wall, so it only settles. At a few frames the program prints the
height of the center of mass in mm, the root mean square speed in mm/s and the largest density. With `--solver` it
prints the same of SPlisHSPlasH, which takes some ten times as long.

With `--solver` the result is written to `benchmarks/results/at_rest.json`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from record import write_result
from surfsup.datasets.density import number_density
from surfsup.datasets.recipes.tanks import GAP
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import Scene
from surfsup.simulation import Simulation
from surfsup.splishsplash import solver

PRINTED_FRAMES = (0, 100, 200, 400, 800, 1200, 1600, 2000)

Frames = Iterator[tuple[np.ndarray, np.ndarray]]
Row = dict[str, float]  # frame, height in mm, speed in mm/s, largest density


def scene_of(side: float, depth: float, frames: int) -> Scene:
    """A container whose floor is covered with water."""
    half = side / 2 - GAP
    block = {"min": [-half, -half, GAP], "max": [half, half, GAP + depth]}
    description = {"container": {"size": [side, side, 1.0]}, "fluid": [{"block": block}], "frames": frames}
    return Scene.from_yaml(json.dumps(description), "the benchmark's scene", Path())


def root_mean_square_speed(velocities: np.ndarray) -> float:
    """In mm/s, of particles (N, 3) in m/s."""
    return 1000 * float(np.sqrt((velocities**2).sum(axis=1).mean()))


def measure(name: str, frames: Frames, last: int) -> list[Row]:
    """One row for each of the printed frames."""
    rows = []
    for number, (positions, velocities) in enumerate(frames):
        if number in PRINTED_FRAMES or number == last:
            height, speed = 1000 * float(positions[:, 2].mean()), root_mean_square_speed(velocities)
            density = float(number_density(positions.T.astype(np.float64)).max())
            rows.append({"frame": number, "height_mm": height, "speed_mm_s": speed, "density": density})
            print(
                f"{name}, frame {number}: {height:.2f} mm high, {speed:.2f} mm/s, density {density:.3f} at most",
                flush=True,
            )
    return rows


def pairs_of(simulation: Simulation) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Positions and velocities of each frame."""
    return ((frame.positions, frame.velocities) for frame in simulation.run())


def main() -> None:
    """Measure the simulator, then the reference solver if requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--simulator", default=DEFAULT_SIMULATOR, help="name or weights file")
    parser.add_argument("--frames", type=int, default=2001)
    parser.add_argument("--side", type=float, default=0.6, help="meters of the container")
    parser.add_argument("--depth", type=float, default=0.3, help="meters of water")
    parser.add_argument("--solver", action="store_true")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    scene = scene_of(arguments.side, arguments.depth, arguments.frames)
    start = scene.initial_particles(None)
    print(f"{len(start.positions)} particles")
    last = arguments.frames - 1
    rows = measure(arguments.simulator, pairs_of(Simulation(scene, arguments.simulator, "cpu")), last)
    if not arguments.solver:
        return
    peer = measure("SPlisHSPlasH", solver.simulate(scene, None, start), last)
    if arguments.simulator == DEFAULT_SIMULATOR:
        write_result(
            "at_rest",
            f"Root mean square speed of a pool {arguments.depth:g} m deep after {last:,} frames",
            round(rows[-1]["speed_mm_s"], 2),
            "mm/s",
            "SPlisHSPlasH, fixed step of 1 ms",
            round(peer[-1]["speed_mm_s"], 2),
            " ".join(["python benchmarks/at_rest.py", *sys.argv[1:]]),
            values={"surfsup": rows, "SPlisHSPlasH": peer},
            threads=1,
        )


if __name__ == "__main__":
    main()
