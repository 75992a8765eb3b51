"""Error of a simulator ten frames after a true state: the most sensitive measure of what training has learned.

    python benchmarks/ten_frames.py [DATA] [--scenes 10] [--simulator NAME OR FILE ...]

Plain Chamfer distance in meters, mean over the first scenes of a data set: ten frames after each of twenty frames of
the reference around the impact; and of rollouts from the scenes' starts, at frames 60, 80 and 100. An effect of
training shows in the first column after a few thousand steps, long before rollouts show it (docs/log.md).
"""

from __future__ import annotations

import argparse
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from error_growth import rollout_errors
from surfsup.io.trajectory import Trajectory
from surfsup.learned.loading import load_simulator
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.sph.simulator import Simulator

START_FRAMES = range(40, 155, 6)  # from the first contact to the height of the splash
LENGTH = 10
MEASURED_FRAMES = (60, 80, 100)


def errors_of(path: Path, simulator: Simulator) -> list[float]:
    """Errors in one scene: the mean ten frames after a true state, then those of the rollout from the start."""
    with Trajectory(path) as trajectory:
        scene = trajectory.scene
        reference, velocities = trajectory.window(0, START_FRAMES[-1] + LENGTH + 1)
    known = simulator, scene, scene.build_surface(), reference, velocities
    after = [rollout_errors(*known, first, (first + LENGTH,))[first + LENGTH] for first in START_FRAMES]
    return [float(np.mean(after)), *rollout_errors(*known, 0, MEASURED_FRAMES).values()]


def main() -> None:
    """Print a row for each simulator."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="?", default=Path("data/prim-shapes-validation"))
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--simulator", nargs="+", default=[DEFAULT_SIMULATOR], help="names or weights files")
    arguments = parser.parse_args()
    torch.set_grad_enabled(False)
    torch.set_num_threads(1)
    frames = "".join(f"{'frame ' + str(frame):>12}" for frame in MEASURED_FRAMES)
    print(f"{'Chamfer, m':<40}{'ten frames':>12}{frames}")
    for name in arguments.simulator:
        simulator, _ = load_simulator(name)
        found = [errors_of(path, simulator) for path in islice(sorted(arguments.data.glob("*.h5")), arguments.scenes)]
        print(f"{name:<40}" + "".join(f"{value:>12.4f}" for value in np.mean(found, axis=0)), flush=True)


if __name__ == "__main__":
    main()
