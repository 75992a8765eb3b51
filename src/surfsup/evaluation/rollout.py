"""A model's rollout from the start of a true trajectory, as a trajectory file of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import torch

from surfsup.errors import SimulationError
from surfsup.io.trajectory import Provenance, Trajectory, TrajectoryWriter
from surfsup.sph.simulator import Simulator, StateType
from surfsup.sph.state import Environment


@torch.no_grad()
def roll_out(
    model: Simulator,
    truth: Trajectory,
    frames: int,
    path: Path,
    name: str,
    device: str,
    handle_collisions: bool,
    tell: Callable[[int], None],
) -> float:
    """Write to ``path`` what ``model`` makes of the start of ``truth``, over so many ``frames``.

    From the frame on in which a rollout is no longer a number, or has collapsed, all its particles are written as NaN:
    they are lost, and the file is as long as any.

    Args:
        model: the simulator.
        truth: where to start.
        frames: how many to write, the start among them.
        path: of the trajectory file, replaced if it is there.
        name: of the model, for the file.
        device: where to compute.
        handle_collisions: whether the guard against penetration is on.
        tell: told how many frames are done.

    Returns:
        The share of particles that the guard moved, mean over frames.

    Raises:
        InputError: a mesh file of the scene is not usable, or ``path`` cannot be written.
    """
    scene = truth.scene.with_frames(frames)
    environment = Environment.of(scene, scene.build_surface(), device)
    start, velocities = (torch.from_numpy(data[0]).to(device) for data in (truth.positions, truth.velocities))
    model = model.to(device)
    rollout = model.rollout(model.start(start, velocities, environment), environment, frames, handle_collisions)
    gone = np.full(start.shape, np.nan, dtype=np.float32)
    shares = []
    with TrajectoryWriter(path, scene, Provenance(name), len(start)) as writer:
        for now, moved in while_sound(rollout):
            writer.append(now.positions.cpu().numpy(), now.velocities.cpu().numpy())
            shares.append(float(moved.float().mean()))
            tell(len(shares))
        for number in range(len(shares), frames):
            writer.append(gone, gone)
            tell(number + 1)
    return float(np.mean(shares))


def while_sound(rollout: Iterator[tuple[StateType, torch.Tensor]]) -> Iterator[tuple[StateType, torch.Tensor]]:
    """The frames of a rollout before the one in which it is no longer a number, or has collapsed into a clump."""
    with suppress(SimulationError):
        for now, moved in rollout:
            if not (now.positions.isfinite().all() and now.velocities.isfinite().all()):
                return
            yield now, moved
