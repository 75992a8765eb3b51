"""How far ten frames of the model are from the truth that they began at: the sharpest measure of what it has learned.

    python benchmarks/ten_frames.py [DATA] [--scenes 10] [--model NAME OR FILE ...]

Plain Chamfer, meters, means over the first scenes of a data set: of rollouts begun at twenty true frames of the splash
of each, ten frames later; and of rollouts from the scenes' starts, at frames 60, 80 and 100. What training does to the
first shows after a few thousand steps, long before whole rollouts tell it from chance (docs/experiments.md).
"""

from __future__ import annotations

import argparse
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from straying import rolled_out
from surfsup.io.trajectory import Trajectory
from surfsup.learned import weights_file
from surfsup.sph.simulator import Simulator

BEGUN = range(40, 155, 6)  # from the first touches to the height of the splash
LENGTH = 10
ASKED = (60, 80, 100)


def errors_of(path: Path, model: Simulator) -> list[float]:
    """Of one scene: the mean ten frames after a truth, then those of the rollout from its start."""
    with Trajectory(path) as trajectory:
        scene = trajectory.scene
        truth, velocities = trajectory.window(0, BEGUN[-1] + LENGTH + 1)
    known = model, scene, scene.build_surface(), truth, velocities
    after = [rolled_out(*known, first, (first + LENGTH,))[first + LENGTH] for first in BEGUN]
    return [float(np.mean(after)), *rolled_out(*known, 0, ASKED).values()]


def main() -> None:
    """Print a row a model."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="?", default=Path("data/prim-shapes-validation"))
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--model", nargs="+", default=[weights_file.DEFAULT_MODEL])
    arguments = parser.parse_args()
    torch.set_grad_enabled(False)
    torch.set_num_threads(1)
    print(f"{'Chamfer, m':<40}{'ten frames':>12}" + "".join(f"{'frame ' + str(frame):>12}" for frame in ASKED))
    for name in arguments.model:
        model, _ = weights_file.load(weights_file.find(name))
        found = [errors_of(path, model) for path in islice(sorted(arguments.data.glob("*.h5")), arguments.scenes)]
        print(f"{name:<40}" + "".join(f"{value:>12.4f}" for value in np.mean(found, axis=0)), flush=True)


if __name__ == "__main__":
    main()
