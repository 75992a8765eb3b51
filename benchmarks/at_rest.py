"""A pool at rest: does it keep its height and stay still, over 2,000 frames, beside the solver's own.

    python benchmarks/at_rest.py [--model NAME] [--frames 2000] [--side 0.6] [--depth 0.3] [--solver]

Water fills the floor of a container from wall to wall and has nothing to do but settle. Told are the height of its
center of mass in mm, its root mean square speed in mm/s and its highest density, at a few frames; with --solver the
same of SPlisHSPlasH, some ten times slower.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from surfsup.datasets.density import number_density
from surfsup.datasets.recipes.tanks import GAP
from surfsup.learned import weights_file
from surfsup.scene import Scene
from surfsup.simulation import simulate
from surfsup.splishsplash import solver

TOLD = (0, 100, 200, 400, 800, 1200, 1600, 2000)  # frames

Frames = Iterator[tuple[np.ndarray, np.ndarray]]


def scene_of(side: float, depth: float, frames: int) -> Scene:
    """A container of which the water covers the floor."""
    half = side / 2 - GAP
    block = {"min": [-half, -half, GAP], "max": [half, half, GAP + depth]}
    told = {"container": {"size": [side, side, 1.0]}, "fluid": [{"block": block}], "frames": frames}
    return Scene.from_yaml(json.dumps(told), "the benchmark's scene", Path())


def root_mean_square_speed(velocities: np.ndarray) -> float:
    """In mm/s, of particles (N, 3) in m/s."""
    return 1000 * float(np.sqrt((velocities**2).sum(axis=1).mean()))


def tell(name: str, frames: Frames, last: int) -> None:
    """One line for each of the chosen frames."""
    for number, (positions, velocities) in enumerate(frames):
        if number in TOLD or number == last:
            speed = root_mean_square_speed(velocities)
            density = number_density(positions.T.astype(np.float64)).max()
            print(
                f"{name}, frame {number}: {1000 * positions[:, 2].mean():.2f} mm high, {speed:.2f} mm/s, "
                f"density {density:.3f} at most",
                flush=True,
            )


def main() -> None:
    """Ours, then the solver's where it is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default=weights_file.DEFAULT_MODEL)
    parser.add_argument("--frames", type=int, default=2001)
    parser.add_argument("--side", type=float, default=0.6, help="meters of the container")
    parser.add_argument("--depth", type=float, default=0.3, help="meters of water")
    parser.add_argument("--solver", action="store_true")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    scene = scene_of(arguments.side, arguments.depth, arguments.frames)
    start = scene.start(None)
    print(f"{len(start.positions)} particles")
    model, _ = weights_file.load(weights_file.find(arguments.model))
    tell(arguments.model, simulate(model, scene, None, start, "cpu"), arguments.frames - 1)
    if arguments.solver:
        tell("solver", solver.simulate(scene, None, start), arguments.frames - 1)


if __name__ == "__main__":
    main()
