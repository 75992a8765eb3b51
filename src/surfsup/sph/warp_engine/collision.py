"""Collision handling in Warp, as operations of torch; the solid is queried by torch between them.

Nothing here waits for the device, except for :func:`resolve_collisions` at its end.
"""

from __future__ import annotations

from typing import Any

import torch
import warp as wp
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup import warp_runtime as runtime
from surfsup.sph.clearance import ROUNDS, CollisionResult, LastQuery
from surfsup.sph.environment import Environment
from surfsup.sph.warp_engine.crossing import stop_crossings
from surfsup.sph.warp_engine.kernels.collision import collision_kernels
from surfsup.warp_runtime import Precision, precision_of

MIN_ROWS, ROW_SHARE = 1024, 4  # a GPU's list has room for this many particles, or for one in so many


class NearList:
    """Particles that may be too close to the solid, listed on the device.

    Where its rows in use are counted, only they are computed. A GPU computes all rows, so that the host need not know
    how many are in use.

    Args:
        rows: rows for which there is room.
        device: Warp's.
        counted: whether rows are counted before they are computed.

    Attributes:
        near: (rows,) int32, indices of particles; zero in rows that are not in use.
        length: (1,) int32; more than there are rows if some particles found no room.
    """

    def __init__(self, rows: int, device: Any, counted: bool) -> None:
        self.rows, self.counted = rows, counted
        self.near = wp.zeros(rows, dtype=int, device=device)
        self.length = wp.zeros(1, dtype=int, device=device)

    def next(self) -> NearList:
        """An empty list with as many rows."""
        return NearList(self.rows, self.near.device, self.counted)

    def rows_to_compute(self) -> int:
        """All rows, or those in use if they are counted."""
        return self.rows_in_use() if self.counted else self.rows

    def rows_in_use(self) -> int:
        """Particles that were to be listed. Waits for the device."""
        return int(runtime.to_torch(self.length).cpu())


def near_list(like: Tensor, rows: int | None = None) -> NearList:
    """A list for particles like these (N, 3): counted on a CPU.

    Args:
        like: the particles.
        rows: of a list that is not counted; by default a share of the particles.
    """
    count, device = len(like), runtime.warp_device(like.device)
    if rows is not None:
        return NearList(min(rows, count), device, counted=False)
    if like.device.type == "cpu":
        return NearList(count, device, counted=True)
    return NearList(min(count, max(MIN_ROWS, count // ROW_SHARE)), device, counted=False)


class Collisions:
    """The kernels with the container's corners, for particles on a device.

    Args:
        environment: container.
        like: particles whose device and precision are used.
    """

    def __init__(self, environment: Environment, like: Tensor) -> None:
        self.precision: Precision = precision_of(like.dtype)
        self.kernels, self.device = collision_kernels(self.precision), runtime.warp_device(like.device)
        self.corners = [self.precision.vec3(*corner.tolist()) for corner in environment.on_host[:2]]

    def vectors(self, *tensors: Tensor) -> list[wp.array]:
        """Tensors (N, 3) as arrays of vectors."""
        return [runtime.to_warp(tensor, self.precision.vec3) for tensor in tensors]

    def query(self, distance: Tensor, normal: Tensor) -> list[wp.array]:
        """Distance and normal as arrays."""
        return [runtime.to_warp(distance, self.precision.real), *self.vectors(normal)]

    def launch(self, kernel: wp.Kernel, threads: int, inputs: list[Any], outputs: list[Any]) -> None:
        """Run a kernel."""
        wp.launch(kernel, threads, inputs, outputs, device=self.device)

    def list_near(self, positions: Tensor, last: LastQuery, near: NearList) -> None:
        """List the particles that may have come closer to the solid than the clearance since the ``last`` query."""
        distance = runtime.to_warp(last.distance, self.precision.real)
        inputs = [*self.vectors(positions, last.positions), distance]
        self.launch(self.kernels.list_near, len(positions), inputs, [near.near, near.length])


class Contained(torch.autograd.Function):
    """Particles clamped into the container, and which of them (N,) were moved."""

    @staticmethod
    def forward(ctx: Any, collisions: Collisions, positions: Tensor, velocities: Tensor) -> tuple[Tensor, ...]:
        """From positions and velocities (N, 3)."""
        ctx.collisions = collisions
        ctx.save_for_backward(positions, velocities)
        found = runtime.empty_like(positions), runtime.empty_like(velocities)
        collided = torch.empty(len(positions), dtype=torch.bool, device=positions.device)
        collisions.launch(
            collisions.kernels.clamp_to_container,
            len(positions),
            [*collisions.vectors(positions, velocities), *collisions.corners],
            [*collisions.vectors(*found), runtime.to_warp(collided, wp.bool)],
        )
        ctx.mark_non_differentiable(collided)
        return *found, collided

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, of_positions: Tensor, of_velocities: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
        """Derivatives in positions and velocities."""
        collisions, state = ctx.collisions, ctx.saved_tensors
        found = runtime.empty_like(of_positions), runtime.empty_like(of_velocities)
        with runtime.on_stream(of_positions.device):
            collisions.launch(
                collisions.kernels.clamp_adjoint,
                len(of_positions),
                [*collisions.vectors(*state), *collisions.corners, *collisions.vectors(of_positions, of_velocities)],
                collisions.vectors(*found),
            )
        return None, *found


class Projected(torch.autograd.Function):
    """Particles after a round of projection out of the solid."""

    @staticmethod
    def forward(
        ctx: Any,
        collisions: Collisions,
        near: NearList,
        moved: NearList,
        collided: Tensor,
        positions: Tensor,
        velocities: Tensor,
        distance: Tensor,
        normal: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Positions and velocities (N, 3), from those and distance and normal of the rows; ``moved`` lists who moved.

        ``collided`` (N,) is set in place.
        """
        ctx.collisions, ctx.near = collisions, near
        ctx.save_for_backward(positions, velocities, distance, normal)
        found = runtime.copy_of(positions), runtime.copy_of(velocities)
        collisions.launch(
            collisions.kernels.project,
            len(distance),
            [near.near, near.length, *collisions.query(distance, normal), *collisions.corners],
            [*collisions.vectors(*found), runtime.to_warp(collided, wp.bool), moved.near, moved.length],
        )
        return found

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, of_positions: Tensor, of_velocities: Tensor) -> tuple[Tensor | None, ...]:
        """Derivatives in positions, velocities, distance and normal."""
        collisions, near = ctx.collisions, ctx.near
        *state, distance, normal = ctx.saved_tensors
        found = runtime.copy_of(of_positions), runtime.copy_of(of_velocities)
        in_solid = runtime.empty_like(distance), runtime.empty_like(normal)
        with runtime.on_stream(of_positions.device):
            collisions.launch(
                collisions.kernels.project_adjoint,
                len(distance),
                [
                    near.near,
                    near.length,
                    *collisions.query(distance, normal),
                    *collisions.corners,
                    *collisions.vectors(*state),
                ],
                [*collisions.vectors(*found), *collisions.query(*in_solid)],
            )
        return None, None, None, None, *found, *in_solid


class Returned(torch.autograd.Function):
    """Particles, those that are still inside the solid back where they were."""

    @staticmethod
    def forward(
        ctx: Any,
        collisions: Collisions,
        near: NearList,
        distance: Tensor,
        before: Tensor,
        positions: Tensor,
        velocities: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Positions and velocities (N, 3), from those, where the particles were, and the distance of the rows."""
        ctx.collisions, ctx.near, ctx.distance = collisions, near, runtime.to_warp(distance, collisions.precision.real)
        found = runtime.copy_of(positions), runtime.copy_of(velocities)
        collisions.launch(
            collisions.kernels.return_stuck,
            len(distance),
            [near.near, near.length, ctx.distance, *collisions.vectors(before)],
            collisions.vectors(*found),
        )
        return found

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, of_positions: Tensor, of_velocities: Tensor) -> tuple[Tensor | None, ...]:
        """Derivatives in where the particles were, positions and velocities."""
        collisions, near = ctx.collisions, ctx.near
        found = runtime.empty_like(of_positions).zero_(), runtime.copy_of(of_positions), runtime.copy_of(of_velocities)
        with runtime.on_stream(of_positions.device):
            collisions.launch(
                collisions.kernels.return_adjoint,
                len(ctx.distance),
                [near.near, near.length, ctx.distance],
                collisions.vectors(*found),
            )
        return None, None, None, *found


def leave_solid(
    collisions: Collisions,
    before: Tensor,
    contained: tuple[Tensor, Tensor, Tensor],
    environment: Environment,
    last: LastQuery | None,
    near: NearList,
) -> CollisionResult:
    """Particles inside the container, after projection out of the solid.

    Args:
        collisions: the kernels.
        before: (N, 3) positions one frame earlier, none inside the solid.
        contained: positions and velocities (N, 3), and which (N,) the walls moved.
        environment: container and solid.
        last: an earlier query of the solid; None for none.
        near: an empty list; afterwards it shows whether it had room.
    """
    positions, velocities, collided = contained
    if environment.surface is None:
        return CollisionResult(positions, velocities, collided)
    if positions.device.type == "cpu":  # on a GPU the host would wait to learn who is fast
        positions, stopped = stop_crossings(before, positions, environment.surface, last)
        if stopped is not None:
            collided[stopped] = True
    if last is None:
        with torch.no_grad():
            last = LastQuery(positions, environment.surface.distance(positions))
    collisions.list_near(positions, last, near)
    for _ in range(ROUNDS):
        rows = near.rows_to_compute()
        if rows == 0:
            return CollisionResult(positions, velocities, collided)
        points = positions.index_select(0, runtime.to_torch(near.near)[:rows])
        distance, normal = environment.distance_and_normal(points)
        moved = near.next()
        positions, velocities = Projected.apply(
            collisions, near, moved, collided, positions, velocities, distance.contiguous(), normal.contiguous()
        )
        near = moved
    rows = near.rows_to_compute()
    if rows > 0:
        with torch.no_grad():
            distance = environment.surface.distance(positions.index_select(0, runtime.to_torch(near.near)[:rows]))
        positions, velocities = Returned.apply(collisions, near, distance, before, positions, velocities)
    return CollisionResult(positions, velocities, collided)


def resolve_collisions(
    before: Tensor, positions: Tensor, velocities: Tensor, environment: Environment, last: LastQuery | None
) -> CollisionResult:
    """See :func:`surfsup.sph.collision.resolve_collisions`; differentiable. Waits for the device at the end."""
    if len(positions) == 0:
        return CollisionResult(positions, velocities, torch.zeros(0, dtype=torch.bool, device=positions.device))
    runtime.load_for(collision_kernels, positions)
    with runtime.on_stream(positions.device):
        collisions = Collisions(environment, positions)
        rows = None
        while True:
            contained = Contained.apply(collisions, positions, velocities)
            if environment.surface is None:
                return CollisionResult(*contained)
            near = near_list(positions, rows)
            result = leave_solid(collisions, before, contained, environment, last, near)
            if near.counted or near.rows_in_use() <= near.rows:
                return result
            rows = len(positions)
