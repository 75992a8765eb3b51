"""A picture of a rollout above the truth, at a few moments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from surfsup.evaluation.rollout import while_sound
from surfsup.io.trajectory import Trajectory
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import Environment
from surfsup.viewing.trajectory_pictures import renderer_of

MOMENTS = 3
SIZE = (480, 360)  # pixels of each picture


@torch.no_grad()
def draw_rollout(model: Simulator, path: Path, frames: int) -> np.ndarray:
    """Three moments of what ``model`` makes of a start, and below them the truth, as (height, width, 3) uint8.

    Args:
        model: the simulator.
        path: the true trajectory's file.
        frames: how far; the moments are at a third, two thirds and the end.

    Raises:
        InputError: this machine cannot draw, or the file is no trajectory.
    """
    device = next(model.parameters()).device
    with Trajectory(path) as truth:
        frames = min(frames, len(truth))
        chosen = sorted({round(number * (frames - 1) / MOMENTS) for number in range(1, MOMENTS + 1)})
        environment = Environment.of(truth.scene, truth.scene.build_surface(), device)
        start, velocities = (torch.from_numpy(data[0]).to(device) for data in (truth.positions, truth.velocities))
        rollout = model.rollout(model.start(start, velocities, environment), environment, frames)
        made = {}
        for number, (state, _) in enumerate(while_sound(rollout)):
            if number in chosen:
                made[number] = state.positions.cpu().numpy()
        renderer = renderer_of(truth, SIZE)
        gone = np.empty((0, 3), np.float32)  # a rollout that blew up or collapsed leaves an empty stage
        rows = [
            np.hstack([renderer.image(made.get(number, gone)) for number in chosen]),
            np.hstack([renderer.image(truth.positions[number]) for number in chosen]),
        ]
        renderer.close()
    return np.vstack(rows)
