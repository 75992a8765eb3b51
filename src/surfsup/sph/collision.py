"""The guard: no particle ends a frame in the solid or outside the container, whatever the network says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.sph.state import Environment

# Meters from solid and walls to a particle's middle, where the guard begins. The solver's own water comes no nearer
# than 21.8 mm (13 scenes): what lies between are the network's errors, which it mends by itself in the next frames.
CLEARANCE = 0.020
ROUNDS = 4
TOLERANCE = 1e-5  # meters that a particle may stay short of its clearance
ALLOWED = (CLEARANCE, TOLERANCE, ROUNDS)  # as the native code takes it


@dataclass(frozen=True)
class Look:
    """Where the solid was looked at in a frame already.

    Attributes:
        places: (N, 3) of the particles then, meters.
        distance: (N,) of the solid from there, meters.
    """

    places: Tensor
    distance: Tensor


@dataclass(frozen=True)
class CollisionResult:
    """What the guard made of a frame.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s.
        moved: (N,) bool, which particles it had to move.
    """

    positions: Tensor
    velocities: Tensor
    moved: Tensor


def resolve_collisions(
    before: Tensor, positions: Tensor, velocities: Tensor, environment: Environment, last: Look | None = None
) -> CollisionResult:
    """Push particles out along the normal and take away the part of their velocity that points in.

    A push may end too close to a
    wall or to another part of the solid, so it is repeated, a few rounds at most. A particle that is still
    inside the solid then, in a crease too narrow for it, stays where it was ``before``: so penetration is
    zero by construction as long as the start has none.

    Args:
        before: (N, 3) positions one frame earlier, none inside the solid or outside the container.
        positions: (N, 3) as the network wants them, meters.
        velocities: (N, 3), m/s.
        environment: container and solid.
        last: a look at the solid from near where the particles are now: those that were so far from it that they cannot
            have come too close since are not looked at again.
    """
    if can_resolve_natively(positions, velocities, environment):
        return resolve_collisions_native(before, positions, velocities, environment, last)
    positions, velocities, moved = into_container(positions, velocities, environment)
    if environment.surface is None:
        return CollisionResult(positions, velocities, moved)
    at = within_reach(positions, last).nonzero()[:, 0]
    for _ in range(ROUNDS):
        distance, normal = environment.distance_and_normal(positions[at])
        deep = CLEARANCE - distance > TOLERANCE
        if not bool(deep.any()):
            return CollisionResult(positions, velocities, moved)
        at, distance, normal = at[deep], distance[deep], normal[deep]
        pushed = positions[at] + (CLEARANCE - distance)[:, None] * normal
        speed_in = (velocities[at] * normal).sum(dim=-1, keepdim=True).clamp(max=0)
        pushed, slowed, _ = into_container(pushed, velocities[at] - speed_in * normal, environment)
        positions, velocities = positions.index_copy(0, at, pushed), velocities.index_copy(0, at, slowed)
        moved = moved.index_fill(0, at, True)
    stuck = at[environment.distance_and_normal(positions[at])[0] < 0]
    positions = positions.index_copy(0, stuck, before[stuck])
    velocities = velocities.index_fill(0, stuck, 0.0)
    return CollisionResult(positions, velocities, moved)


def can_resolve_natively(positions: Tensor, velocities: Tensor, environment: Environment) -> bool:
    """Whether the native parts are built, all is single precision on the CPU and no gradient is wanted."""
    return bool(native.instruction_sets()) and all(
        value.dtype == torch.float32
        and value.device.type == "cpu"
        and not (torch.is_grad_enabled() and (value.requires_grad or environment.records_gradients()))
        for value in (positions, velocities, environment.lower, environment.upper)
    )


def resolve_collisions_native(
    before: Tensor, positions: Tensor, velocities: Tensor, environment: Environment, last: Look | None
) -> CollisionResult:
    """The same in C++, where only whoever has to be asked about the solid may need a second thread.

    Torch's threads wait for each other after each of its many small steps; where others compute beside them that took
    longer than the network.
    """
    fluid = [value.detach().numpy().copy() for value in (positions, velocities)] + [np.empty(len(positions), bool)]
    looked = None
    if last is not None:
        looked = tuple(value.detach().contiguous().numpy() for value in (last.places, last.distance))
    native.guard(
        before.detach().contiguous().numpy(),
        *fluid,
        environment.lower.numpy(),
        environment.upper.numpy(),
        ALLOWED,
        environment.asked(),
        looked,
        native.instruction_sets()[0],
        torch.get_num_threads(),
    )
    return CollisionResult(*(torch.from_numpy(value) for value in fluid))


def within_reach(positions: Tensor, last: Look | None) -> Tensor:
    """Which particles (N,) may have come too close to the solid since the ``last`` look at it.

    No value of a surface is larger than the distance, so what has gone less than that is still outside; a learned
    surface may exaggerate, and is believed half.
    """
    if last is None:
        return torch.ones(len(positions), dtype=torch.bool, device=positions.device)
    spare = last.distance.detach() - CLEARANCE
    return ~(2 * torch.linalg.vector_norm(positions.detach() - last.places.detach(), dim=-1) < spare)


def into_container(positions: Tensor, velocities: Tensor, environment: Environment) -> tuple[Tensor, Tensor, Tensor]:
    """Positions (N, 3) inside the walls, velocities (N, 3) that do not point out, which (N,) were moved."""
    lower, upper = environment.lower + CLEARANCE, environment.upper - CLEARANCE
    inside = torch.minimum(torch.maximum(positions, lower), upper)
    crossed = inside != positions
    leaving = crossed & (velocities * (inside - positions) < 0)
    return inside, torch.where(leaving, 0.0, velocities), crossed.any(dim=-1)
