"""Collision handling: no particle ends a frame inside the solid or outside the container, with any simulator."""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.native.dispatch import can_run_native, fastest_isa
from surfsup.sph.clearance import CLEARANCE, LIPSCHITZ_BOUND, ROUNDS, TOLERANCE, CollisionResult, LastQuery
from surfsup.sph.environment import Environment
from surfsup.sph.moving import FrameMotion
from surfsup.sph.native_query import native_query


def resolve_collisions(
    before: Tensor,
    positions: Tensor,
    velocities: Tensor,
    environment: Environment,
    last: LastQuery | None = None,
    masses: np.ndarray | None = None,
) -> CollisionResult:
    """Project particles out of the solid along its normal, and remove velocity that points into it.

    A projection may end too close to a wall or to another part of the solid, so it is repeated for a few rounds. A
    particle that is still inside then, in a crease too narrow for it, returns to where it was ``before``. So no
    particle is ever inside, provided that none is at the start. A particle whose straight path from before leads
    through the solid first returns to where it entered, so that none passes, however thin the solid; on a GPU this is
    missing.

    Args:
        before: (N, 3) positions one frame earlier, none inside the solid or outside the container.
        positions: (N, 3) as the simulator computed them, meters.
        velocities: (N, 3), m/s.
        environment: container and solid.
        last: an earlier query of the solid. Particles that cannot have come near since then skip the query.
        masses: (N,) float32 of the particles of a mixture, for their impulses.
    """
    in_cpp = can_run_native(positions, velocities, environment.lower, environment.upper, module=environment.surface)
    if environment.motion is not None and in_cpp and not environment.motion.requires_grad:
        return resolve_moving_collisions(before, positions, velocities, environment, environment.motion, masses)
    if environment.motion is None and in_cpp:
        return resolve_collisions_native(before, positions, velocities, environment, last, masses)
    if environment.motion is None and environment.impulses is None:
        from surfsup.sph.warp_engine import collision

        return collision.resolve_collisions(before, positions, velocities, environment, last)
    from surfsup.sph.warp_engine import contacts

    return contacts.resolve_collisions(before, positions, velocities, environment, masses)


def resolve_moving_collisions(
    before: Tensor,
    positions: Tensor,
    velocities: Tensor,
    environment: Environment,
    motion: FrameMotion,
    masses: np.ndarray | None = None,
) -> CollisionResult:
    """:func:`resolve_collisions` beside solids and walls that move from before to after, in C++.

    In the frame of a solid, its motion is part of a particle's path. A path that enters the solid ends there, so that
    no particle passes, however thin the solid. The velocity that a contact removes is that relative to the solid. A
    particle that stays inside moves with the solid.
    """
    new_positions, new_velocities = (value.detach().numpy().copy() for value in (positions, velocities))
    collided = np.empty(len(positions), bool)
    impulses = None if environment.impulses is None else environment.impulses.native(new_positions, masses)
    native.resolve_moving_collisions(
        before.detach().contiguous().numpy(),
        new_positions,
        new_velocities,
        collided,
        environment.lower.numpy(),
        environment.upper.numpy(),
        collision_parameters(),
        native_query(environment),
        motion.native(count=len(positions)),
        motion.seconds,
        impulses,
        fastest_isa(),
        torch.get_num_threads(),
    )
    if environment.impulses is not None and impulses is not None:
        environment.impulses.add(impulses[0], motion)
    return CollisionResult(*(torch.from_numpy(value) for value in (new_positions, new_velocities, collided)))


def resolve_collisions_native(
    before: Tensor,
    positions: Tensor,
    velocities: Tensor,
    environment: Environment,
    last: LastQuery | None,
    masses: np.ndarray | None = None,
) -> CollisionResult:
    """:func:`resolve_collisions` in C++."""
    new_positions, new_velocities = (value.detach().numpy().copy() for value in (positions, velocities))
    collided = np.empty(len(positions), bool)
    impulses = None if environment.impulses is None else environment.impulses.native(new_positions, masses)
    query_positions, query_distance = None, None
    if last is not None:
        query_positions, query_distance = (
            value.detach().contiguous().numpy() for value in (last.positions, last.distance)
        )
    native.resolve_collisions(
        before.detach().contiguous().numpy(),
        new_positions,
        new_velocities,
        collided,
        environment.lower.numpy(),
        environment.upper.numpy(),
        collision_parameters(),
        native_query(environment),
        query_positions,
        query_distance,
        impulses,
        fastest_isa(),
        torch.get_num_threads(),
    )
    if environment.impulses is not None and impulses is not None:
        environment.impulses.add(impulses[0], None)
    return CollisionResult(*(torch.from_numpy(value) for value in (new_positions, new_velocities, collided)))


@cache
def collision_parameters() -> native.CollisionParameters:
    """The constants of this module for C++ code."""
    parameters = native.CollisionParameters()
    parameters.clearance, parameters.tolerance, parameters.rounds = CLEARANCE, TOLERANCE, ROUNDS
    parameters.lipschitz_bound = LIPSCHITZ_BOUND
    return parameters
