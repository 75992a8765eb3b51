"""How far a rollout is off the truth when its water has only fallen: in the last frame before it strikes.

    python benchmarks/falling.py [DATA] [--scenes 10] [--models fast runs/other/best.safetensors]

Root mean square distance of the particles from their true places, millimeters, and how near to a wall the water fell.
A fall is known exactly, so all of it is error; the floor's own runs start 1 mm off.
"""

from __future__ import annotations

import argparse
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from surfsup.io.trajectory import Trajectory
from surfsup.learned import weights_file
from surfsup.sdf import Surface
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import Environment

STRIKING = 0.045  # meters from solid or floor
MOST_FRAMES = 120


def last_of_the_fall(truth: np.ndarray, surface: Surface | None, floor: float) -> int:
    """The last frame before any particle of (F, N, 3) is as near as STRIKING."""
    for frame, water in enumerate(truth):
        distance = np.inf if surface is None else float(surface.distance(torch.from_numpy(water)).min())
        if min(distance, float(water[:, 2].min()) - floor) < STRIKING:
            return frame - 1
    return len(truth) - 1


def off(model: Simulator, trajectory: Trajectory) -> tuple[float, float, int]:
    """Millimeters off in the last frame of the fall, meters to the nearest wall at the start, that frame."""
    scene = trajectory.scene
    surface = scene.build_surface()
    truth, _ = trajectory.window(0, min(MOST_FRAMES, len(trajectory)))
    frame = last_of_the_fall(truth, surface, scene.container.lower[2])
    lower, upper = np.array(scene.container.lower)[:2], np.array(scene.container.upper)[:2]
    wall = min(float((truth[0, :, :2] - lower).min()), float((upper - truth[0, :, :2]).min()))
    start, environment = scene.start(surface), Environment.of(scene, surface)
    state = model.start(torch.from_numpy(start.positions), torch.from_numpy(start.particle_velocities), environment)
    for _ in range(frame):
        state, _ = model.step(state, environment)
    apart = np.linalg.norm(state.positions.numpy() - truth[frame], axis=1)
    return 1000 * float(np.sqrt((apart**2).mean())), wall, frame


def main() -> None:
    """Print a row a scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="?", default=Path("data/prim-shapes-validation"))
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--models", nargs="+", default=[weights_file.DEFAULT_MODEL])
    arguments = parser.parse_args()
    torch.set_grad_enabled(False)
    torch.set_num_threads(1)
    models = [weights_file.load(weights_file.find(name))[0] for name in arguments.models]
    print(
        f"{'scene':<12}{'frame':>6}{'wall, m':>9}"
        + "".join(f"{Path(name).parent.name or name:>14}" for name in arguments.models)
    )
    every = []
    for path in islice(sorted(arguments.data.glob("*.h5")), arguments.scenes):
        with Trajectory(path) as trajectory:
            told = [off(model, trajectory) for model in models]
        every.append([far for far, _, _ in told])
        print(f"{path.stem:<12}{told[0][2]:>6}{told[0][1]:>9.3f}" + "".join(f"{far:>11.3f} mm" for far in every[-1]))
    print(f"{'mean':<27}" + "".join(f"{far:>11.3f} mm" for far in np.mean(every, axis=0)))


if __name__ == "__main__":
    main()
