"""A picture of a rollout above the true trajectory, at a few moments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from surfsup.evaluation.rollout import environment_of, roll_out
from surfsup.io.trajectory import Trajectory
from surfsup.learned.base import LearnedSimulator
from surfsup.viewing.trajectory_pictures import TrajectoryRenderer

MOMENTS = 3
SIZE = (480, 360)  # pixels of each picture


@torch.no_grad()
def draw_rollout(model: LearnedSimulator, path: Path, frames: int, handle_collisions: bool = True) -> np.ndarray:
    """Draw three moments of a rollout, and below them the true trajectory, as (height, width, 3) uint8.

    Args:
        model: the simulator.
        path: file of the true trajectory; the rollout starts from its first frame.
        frames: length of the rollout; the moments are at a third, two thirds and the end.
        handle_collisions: whether collision handling keeps particles out of the solid.

    Raises:
        InputError: rendering is impossible on this machine, or the file is not a trajectory.
    """
    device = next(model.parameters()).device
    with Trajectory(path) as truth:
        frames = min(frames, len(truth))
        chosen = sorted({round(number * (frames - 1) / MOMENTS) for number in range(1, MOMENTS + 1)})
        environment = environment_of(truth, device)
        rollout, predicted = roll_out(model, truth, environment, frames, handle_collisions), {}
        for number, (state, _) in enumerate(rollout):
            if number in chosen:
                predicted[number] = state.positions.cpu().numpy()
        renderer = TrajectoryRenderer(truth, SIZE)
        empty = np.empty((0, 3), np.float32)  # a diverged rollout leaves an empty picture
        rows = [
            np.hstack([renderer.render(number, predicted.get(number, empty)) for number in chosen]),
            np.hstack([renderer.render(number) for number in chosen]),
        ]
        renderer.close()
    return np.vstack(rows)
