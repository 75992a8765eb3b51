"""Collision handling: no particle ends a frame inside the solid or outside the container, with any simulator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.native.dispatch import can_run_native, fastest_isa
from surfsup.sph.environment import Environment
from surfsup.sph.moving import FrameMotion
from surfsup.sph.native_query import native_query

# Meters from solid and walls to a particle's center. The reference's water comes no nearer than 21.8 mm.
CLEARANCE = 0.020
ROUNDS = 4
TOLERANCE = 1e-5  # meters by which a particle may fall short of its clearance
LIPSCHITZ_BOUND = 2.0  # of signed distances: a neural one may exceed the true distance by this factor


@dataclass(frozen=True)
class LastQuery:
    """Where each particle last queried the solid.

    Attributes:
        positions: (N, 3) of the particles then, meters.
        distance: (N,) to the solid there, meters.
    """

    positions: Tensor
    distance: Tensor


@dataclass(frozen=True)
class CollisionResult:
    """The particles after collision handling.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s.
        collided: (N,) bool, which particles were moved.
    """

    positions: Tensor
    velocities: Tensor
    collided: Tensor


def resolve_collisions(
    before: Tensor, positions: Tensor, velocities: Tensor, environment: Environment, last: LastQuery | None = None
) -> CollisionResult:
    """Project particles out of the solid along its normal, and remove velocity that points into it.

    A projection may end too close to a wall or to another part of the solid, so it is repeated for a few rounds. A
    particle that is still inside then, in a crease too narrow for it, returns to where it was ``before``. So no
    particle is ever inside, provided that none is at the start.

    Args:
        before: (N, 3) positions one frame earlier, none inside the solid or outside the container.
        positions: (N, 3) as the simulator computed them, meters.
        velocities: (N, 3), m/s.
        environment: container and solid.
        last: an earlier query of the solid. Particles that cannot have come near since then skip the query.
    """
    if environment.motion is not None:
        return resolve_moving_collisions(before, positions, velocities, environment, environment.motion)
    if can_run_native(positions, velocities, environment.lower, environment.upper, module=environment.surface):
        return resolve_collisions_native(before, positions, velocities, environment, last)
    positions, velocities, collided = clamp_to_container(positions, velocities, environment)
    if environment.surface is None:
        return CollisionResult(positions, velocities, collided)
    active = possibly_near(positions, last).nonzero()[:, 0]
    for _ in range(ROUNDS):
        distance, normal = environment.distance_and_normal(positions[active])
        deep = CLEARANCE - distance > TOLERANCE
        if not bool(deep.any()):
            return CollisionResult(positions, velocities, collided)
        active, distance, normal = active[deep], distance[deep], normal[deep]
        projected = positions[active] + (CLEARANCE - distance)[:, None] * normal
        inward = (velocities[active] * normal).sum(dim=-1, keepdim=True).clamp(max=0)
        projected, slowed, _ = clamp_to_container(projected, velocities[active] - inward * normal, environment)
        positions, velocities = positions.index_copy(0, active, projected), velocities.index_copy(0, active, slowed)
        collided = collided.index_fill(0, active, True)
    stuck = active[environment.distance_and_normal(positions[active])[0] < 0]
    positions = positions.index_copy(0, stuck, before[stuck])
    velocities = velocities.index_fill(0, stuck, 0.0)
    return CollisionResult(positions, velocities, collided)


def resolve_moving_collisions(
    before: Tensor, positions: Tensor, velocities: Tensor, environment: Environment, motion: FrameMotion
) -> CollisionResult:
    """:func:`resolve_collisions` beside solids and walls that move from before to after, in C++.

    In the frame of a solid, its motion is part of a particle's path. A path that enters the solid ends there, so that
    no particle passes, however thin the solid. The velocity that a contact removes is that relative to the solid. A
    particle that stays inside moves with the solid.
    """
    new_positions, new_velocities = (value.detach().numpy().copy() for value in (positions, velocities))
    collided = np.empty(len(positions), bool)
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
        fastest_isa(),
        torch.get_num_threads(),
    )
    return CollisionResult(*(torch.from_numpy(value) for value in (new_positions, new_velocities, collided)))


def resolve_collisions_native(
    before: Tensor, positions: Tensor, velocities: Tensor, environment: Environment, last: LastQuery | None
) -> CollisionResult:
    """:func:`resolve_collisions` in C++."""
    new_positions, new_velocities = (value.detach().numpy().copy() for value in (positions, velocities))
    collided = np.empty(len(positions), bool)
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
        fastest_isa(),
        torch.get_num_threads(),
    )
    return CollisionResult(*(torch.from_numpy(value) for value in (new_positions, new_velocities, collided)))


@cache
def collision_parameters() -> native.CollisionParameters:
    """The constants of this module for C++ code."""
    parameters = native.CollisionParameters()
    parameters.clearance, parameters.tolerance, parameters.rounds = CLEARANCE, TOLERANCE, ROUNDS
    return parameters


def possibly_near(positions: Tensor, last: LastQuery | None) -> Tensor:
    """Which particles (N,) may have come closer to the solid than the clearance since the ``last`` query."""
    if last is None:
        return torch.ones(len(positions), dtype=torch.bool, device=positions.device)
    path = torch.linalg.vector_norm(positions.detach() - last.positions.detach(), dim=-1)
    return ~(LIPSCHITZ_BOUND * path < last.distance.detach() - CLEARANCE)


def clamp_to_container(
    positions: Tensor, velocities: Tensor, environment: Environment
) -> tuple[Tensor, Tensor, Tensor]:
    """Positions (N, 3) within the walls, velocities (N, 3) without outward parts, and which (N,) were moved."""
    lower, upper = environment.lower + CLEARANCE, environment.upper - CLEARANCE
    inside = torch.minimum(torch.maximum(positions, lower), upper)
    crossed = inside != positions
    leaving = crossed & (velocities * (inside - positions) < 0)
    return inside, torch.where(leaving, 0.0, velocities), crossed.any(dim=-1)
