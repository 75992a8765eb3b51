"""Rollouts from the first frame of a reference trajectory, in memory or into a trajectory file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import torch

from surfsup.errors import SimulationError
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import FRAME_TIME
from surfsup.scene.pose import Pose
from surfsup.scene.solids import build_solids
from surfsup.sph.environment import Environment
from surfsup.sph.open_water import Passages, WithTaps
from surfsup.sph.simulator import Simulator, StateType


def environment_of(reference: Trajectory, device: torch.device | str = "cpu") -> Environment:
    """The environment of a trajectory of the reference, with its solids where they were at its start.

    Raises:
        InputError: a mesh file of the scene is not valid.
    """
    scene, units = reference.scene, reference.scene.units
    solids = units.solids_to_solver(build_solids(scene), reference.start_time)
    return Environment.of(units.scene_to_solver(scene), solids.still, device, solids)


def until_diverged(rollout: Iterator[tuple[StateType, torch.Tensor]]) -> Iterator[tuple[StateType, torch.Tensor]]:
    """The frames of a rollout up to the first that is not finite or in which the fluid has collapsed."""
    with suppress(SimulationError):
        for state, collided in rollout:
            if not (state.positions.isfinite().all() and state.velocities.isfinite().all()):
                return
            yield state, collided


def roll_out(
    simulator: Simulator[StateType],
    reference: Trajectory,
    environment: Environment,
    frames: int,
    handle_collisions: bool = True,
) -> Iterator[tuple[StateType, torch.Tensor]]:
    """Simulate from the first frame of ``reference`` until the rollout diverges.

    Args:
        simulator: on the device of ``environment``.
        reference: gives the positions and velocities of frame 0.
        environment: of the reference's scene, in the units of the simulators.
        frames: number of frames, frame 0 included.
        handle_collisions: whether collision handling keeps particles out of the solid.

    Returns:
        An iterator over the frames: the state, in the units of the simulators, and which particles (N,) collision
        handling moved.
    """
    device, ids = environment.gravity.device, reference.ids(0)
    start = reference.scene.units.frame_to_solver(reference.positions[0][ids], reference.velocities[0][ids])
    positions, velocities = (torch.from_numpy(values).to(device) for values in start)
    state = simulator.initial_state(positions, velocities, environment)
    return until_diverged(simulator.rollout(state, environment, frames, handle_collisions))


@torch.no_grad()
def write_rollout(
    path: Path,
    simulator: Simulator,
    name: str,
    reference: Trajectory,
    frames: int,
    device: str = "cpu",
    handle_collisions: bool = True,
    progress: Callable[[int], None] = lambda done: None,
) -> float:
    """Write a rollout from the first frame of ``reference`` to the trajectory file ``path``.

    The file always has ``frames`` frames. After a rollout has diverged, all particles are written as NaN and so count
    as lost.

    Args:
        path: the trajectory file; an existing file is replaced.
        simulator: the simulator.
        name: of the simulator, for the file.
        reference: gives the scene and frame 0.
        frames: number of frames, frame 0 included.
        device: where to compute.
        handle_collisions: whether collision handling keeps particles out of the solid.
        progress: called with the number of finished frames.

    Returns:
        The share of particles that collision handling moved, mean over frames.

    Raises:
        InputError: a mesh file of the scene is not valid, ``path`` cannot be written, or the simulator knows no taps.
    """
    scene = reference.scene.with_frames(frames)
    units, own_solids = scene.units, build_solids(scene)
    environment = environment_of(reference, device)
    count = len(reference.ids(0))
    if scene.is_open:
        passages = Passages.of(scene, own_solids, reference.start_time)
        simulator = WithTaps(simulator, passages)
        count += passages.taps.count(0.0, (frames - 1) * FRAME_TIME)
    rollout = roll_out(simulator.to(device), reference, environment, frames, handle_collisions)
    lost = np.full((count, 3), np.nan, dtype=np.float32)
    collided_shares = []

    def poses_at(number: int) -> dict[str, Pose]:
        return own_solids.poses(reference.start_time + number * scene.frame_time)

    with TrajectoryWriter(path, scene, Provenance(name), len(lost), start_time=reference.start_time) as writer:
        for number, (state, collided) in enumerate(rollout):
            values = units.frame_from_solver(state.positions.cpu().numpy(), state.velocities.cpu().numpy())
            writer.append(*values, poses_at(number), getattr(state, "ids", None))
            collided_shares.append(float(collided.float().mean()) if len(collided) else 0.0)
            progress(len(collided_shares))
        for number in range(len(collided_shares), frames):
            writer.append(lost, lost, poses_at(number))
            progress(number + 1)
    return float(np.mean(collided_shares))
