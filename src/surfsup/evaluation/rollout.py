"""A model's rollout from the start of a true trajectory, as a trajectory file of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch

from surfsup.model.learned_simulator import LearnedSimulator
from surfsup.model.state import Surroundings
from surfsup.trajectory import Provenance, Trajectory, TrajectoryWriter


@torch.no_grad()
def roll_out(
    model: LearnedSimulator,
    truth: Trajectory,
    path: Path,
    name: str,
    device: str,
    guarded: bool,
    tell: Callable[[int], None],
) -> float:
    """Write to ``path`` what ``model`` makes of the start of ``truth``, over as many frames.

    From the frame on in which a rollout is no longer a number, all its particles are written as NaN: they are
    lost, and the file is as long as the truth.

    Args:
        model: the simulator.
        truth: where to start.
        path: of the trajectory file, replaced if it is there.
        name: of the model, for the file.
        device: where to compute.
        guarded: whether the guard against penetration is on.
        tell: told how many frames are done.

    Returns:
        The share of particles that the guard moved, mean over frames.

    Raises:
        InputError: a mesh file of the scene is not usable, or ``path`` cannot be written.
    """
    scene = truth.scene.with_frames(len(truth))
    around = Surroundings.of(scene, scene.build_surface(), device)
    start, velocities = (torch.from_numpy(data[0]).to(device) for data in (truth.positions, truth.velocities))
    model = model.to(device)
    rollout = model.rollout(model.start(start, velocities, around), around, len(truth), guarded)
    gone = np.full(start.shape, np.nan, dtype=np.float32)
    shares, alive = [], True
    with TrajectoryWriter(path, scene, Provenance(name), len(start)) as writer:
        for number in range(len(truth)):
            frame = (gone, gone)
            if alive:
                now, moved = next(rollout)
                frame = now.positions.cpu().numpy(), now.velocities.cpu().numpy()
                alive = all(bool(np.isfinite(values).all()) for values in frame)
                shares.append(float(moved.float().mean()))
            writer.append(*frame)
            tell(number + 1)
    return float(np.mean(shares))
