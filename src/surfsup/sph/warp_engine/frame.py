"""A frame of the solver in Warp, as one differentiable operation of torch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
import warp as wp
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup import warp_runtime as runtime
from surfsup.sph.state import WHOLE_FRAME, FramePart
from surfsup.sph.warp_engine.boundary import Boundary
from surfsup.sph.warp_engine.impulses import ImpulseSums, add_pressure_impulses
from surfsup.sph.warp_engine.kernels.adjoint import adjoint_kernels
from surfsup.sph.warp_engine.kernels.boundary import PLANE, boundary_kernels
from surfsup.sph.warp_engine.kernels.substeps import substep_kernels
from surfsup.sph.warp_engine.kernels.transfer import transfer_kernels
from surfsup.sph.warp_engine.liquid import LiquidStep
from surfsup.sph.warp_engine.moving_boundary import MovingDensity
from surfsup.sph.warp_engine.neighbors import NeighborSearch, empty_table
from surfsup.warp_runtime import precision_of


class Frame:
    """The pressure solve of a frame: its arrays, and what the backward pass reads of every substep.

    Its particles are sorted by cell. Nothing here waits for the device.

    Args:
        like: (N, 3) particles; device and precision of all arrays.
        boundary: container, solid and gravity.
        capacity: neighbors of a particle for which there is room.
        keep: whether to keep what the backward pass reads.
        part: of a frame: its duration and number of substeps.
        steps: of what moves, in each substep; None where nothing moves.
        sums: to which the impulses on the solids are added; None where they are not requested.
    """

    def __init__(
        self,
        like: Tensor,
        boundary: Boundary,
        capacity: int,
        keep: bool = False,
        part: FramePart = WHOLE_FRAME,
        steps: tuple[Tensor, Tensor] | None = None,
        sums: ImpulseSums | None = None,
    ) -> None:
        self.precision = precision_of(like.dtype)
        self.boundary, self.keep, self.substep_count = boundary, keep, part.substeps
        real, vec3 = self.precision.real, self.precision.vec3
        self.seconds, self.time = real(part.seconds), real(part.seconds / part.substeps)
        self.plane = int(boundary.solid == PLANE)
        self.count, self.dtype, self.torch_device = len(like), like.dtype, like.device
        self.device = runtime.to_warp(like, self.precision.vec3).device
        self.gravity = vec3(*boundary.acceleration.tolist())
        self.fallen = vec3(*(part.seconds * boundary.acceleration).tolist())
        self.solid = [self.vectors(), self.reals(), self.vectors()] if self.plane else [None, None, None]
        self.near_solid = wp.empty(self.count, dtype=int, device=self.device)
        self.rest_density = self.reals()
        self.delta_velocity, self.delta_position = self.vectors(), self.vectors()
        # Positions and velocities from substep to substep; without gradients two sets take turns.
        self.motions = [[self.vectors(), self.vectors()] for _ in range(part.substeps + 1 if keep else 2)]
        self.substeps = [Substep(self) for _ in range(part.substeps if keep else 1)]
        self.sums = sums
        self.liquid: LiquidStep | None = None
        self.moving = None if steps is None else MovingDensity(self, steps)
        self.search = NeighborSearch(self.count, capacity, self.precision, self.device)
        self.factors: Any = empty_table(self.count, capacity, self.precision.real, self.device)

    def run(
        self,
        positions: wp.array,
        velocities: wp.array,
        predicted: wp.array,
        solid: Sequence[wp.array | None],
        ends: Sequence[wp.array],
    ) -> None:
        """Launch the frame.

        Args:
            positions, velocities, predicted: (N,) vectors in the caller's order.
            solid: distance (N,) of a plane solid at the predicted positions in meters, and its normals there (N,);
                twice None with a volume map or no solid.
            ends: (N,) vectors that receive positions and velocities at the frame's end, in the caller's order.
        """
        transfer = transfer_kernels(self.precision)
        self.search.run(positions, predicted)
        self.launch(
            transfer.sort_particles,
            [self.search.order, positions, velocities, predicted, *solid, self.plane],
            [*self.motions[0], *self.solid, self.near_solid],
        )
        self.delta_velocity.zero_()
        self.delta_position.zero_()
        if self.moving is not None:
            self.moving.work.zero_()
        for number in range(self.substep_count):
            self.run_substep(number)
        self.launch(
            transfer.finish_particles,
            [
                self.search.order,
                predicted,
                velocities,
                self.fallen,
                self.delta_position,
                self.delta_velocity,
            ],
            [*ends],
        )

    def run_substep(self, number: int) -> None:
        """Launch a substep."""
        kernels, boundary_kernel = substep_kernels(self.precision), boundary_kernels(self.precision).evaluate_boundary
        neighbors = [self.search.neighbors, self.search.counts]
        motion, following = self.motion(number), self.motion(number + 1)
        substep = self.substeps[number % len(self.substeps)]
        if self.liquid is not None:
            self.liquid.advance(number, motion)
        self.launch(boundary_kernel, [motion[0], *self.solid, *self.boundary.inputs], substep.boundary)
        if self.moving is not None:
            self.moving.add(motion[0], number, substep.boundary)
        self.launch(
            kernels.compute_pressures,
            [
                *(*motion, *neighbors, *substep.boundary, self.near_solid, self.gravity, self.time, number),
                *(None if self.moving is None else self.moving.approach, int(self.moving is not None)),
            ],
            [self.rest_density, self.factors, *substep.results],
        )
        density, _, density_gradient, _, viscous, pressure = substep.results
        if self.liquid is not None and self.liquid.viscous:
            viscous.zero_()
        if self.moving is not None:
            self.moving.add_work(pressure)
        if self.sums is not None:
            add_pressure_impulses(self, self.sums, number, motion[0], pressure)
        self.launch(
            kernels.apply_pressures,
            [
                *(*motion, *neighbors, self.factors, pressure, density, density_gradient, viscous),
                *(self.gravity, self.time, number),
            ],
            [self.delta_velocity, self.delta_position, *following],
        )

    def motion(self, number: int) -> list[wp.array]:
        """Positions and velocities at the start of a substep."""
        return self.motions[number % len(self.motions)]

    def run_on_tensors(
        self, positions: Tensor, velocities: Tensor, predicted: Tensor, distance: Tensor | None, normal: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        """As :meth:`run`, from tensors (N, 3) and (N,); returns positions and velocities (N, 3) at the frame's end."""
        real, vec3 = self.precision.real, self.precision.vec3
        start, speed, ballistic = (runtime.to_warp(value, vec3) for value in (positions, velocities, predicted))
        solid = [runtime.to_warp(distance, real), runtime.to_warp(normal, vec3)] if self.plane else [None, None]
        ends = self.unsorted(), self.unsorted()
        self.run(start, speed, ballistic, solid, [runtime.to_warp(value, vec3) for value in ends])
        return ends

    def record(self) -> FrameRecord:
        """The last substep in the caller's order."""
        substep, motion, vec3 = self.substeps[-1], self.motion(self.substep_count - 1), self.precision.vec3
        difference = self.vectors()
        self.launch(
            substep_kernels(self.precision).sum_velocity_differences,
            [*motion, self.search.neighbors, self.search.counts],
            [difference],
        )
        order = runtime.to_torch(self.search.order).long()
        density, density_rate, density_gradient, squared_gradient, *_ = substep.results
        values = [motion[0], density, density_rate, density_gradient, squared_gradient, *substep.boundary]
        values += [self.rest_density, difference]
        found = []
        for value in values:
            target = self.unsorted(3 if value.dtype is vec3 else 1)
            target[order] = runtime.to_torch(value)
            found.append(target)
        return FrameRecord(*found)

    def backward(self, of_positions: Tensor, of_velocities: Tensor) -> tuple[Tensor | None, ...]:
        """Derivatives in positions, velocities, distance, normal and steps, from those in the frame's end."""
        kernels, transfer = adjoint_kernels(self.precision), transfer_kernels(self.precision)
        boundary_kernel = boundary_kernels(self.precision).evaluate_boundary
        vec3 = self.precision.vec3
        real, rest = self.precision.real, [self.near_solid, self.rest_density]
        time = self.time
        if self.moving is not None:
            self.moving.begin_adjoint()
        position_adjoint, change = self.vectors(), self.vectors()
        self.launch(
            transfer.sort_adjoints,
            [self.search.order, runtime.to_warp(of_positions, vec3), runtime.to_warp(of_velocities, vec3), time],
            [position_adjoint, change],
        )
        no_adjoint = [None if isinstance(value, wp.array) else value for value in self.boundary.inputs]
        neighbors = [self.search.neighbors, self.search.counts]
        rest_adjoint = self.reals(zero=True)
        solid_adjoint = (
            [self.vectors(zero=True), self.reals(zero=True), self.vectors(zero=True)]
            if self.plane
            else [None, None, None]
        )
        own_velocity, of_gradient, of_friction = (self.vectors() for _ in range(3))
        of_value, of_squares, of_approach, of_boundary = (self.reals() for _ in range(4))
        of_boundary_gradient = self.vectors()
        sums = [own_velocity, of_value, of_gradient, of_squares, of_approach, of_friction]
        for number in reversed(range(self.substep_count)):
            substep, motion = self.substeps[number], self.motion(number)
            pressure = substep.results[-1]
            self.launch(
                kernels.pressure_adjoint,
                [
                    *(*motion, *neighbors, substep.boundary[1], *rest, *substep.results),
                    *(self.gravity, time, number, change),
                ],
                [rest_adjoint, *sums, of_boundary, of_boundary_gradient],
            )
            through_boundary = self.vectors(zero=True)
            if self.moving is not None:
                of_density = [of_boundary, of_boundary_gradient, of_approach]
                self.moving.add_adjoint(motion[0], number, substep.boundary, of_density, through_boundary)
            wp.launch(
                boundary_kernel,
                self.count,
                [motion[0], *self.solid, *self.boundary.inputs],
                substep.boundary,
                adj_inputs=[through_boundary, *solid_adjoint, *no_adjoint],
                adj_outputs=[of_boundary, of_boundary_gradient],
                adjoint=True,
                device=self.device,
            )
            following = [self.vectors(), self.vectors()]
            earlier = time if number else real(0.0)
            self.launch(
                kernels.motion_adjoint,
                [*motion, *neighbors, pressure, change, *sums, through_boundary, position_adjoint, earlier],
                following,
            )
            position_adjoint, change = following
        found = [self.unsorted(), self.unsorted()]
        in_solid: list[Tensor | None] = [None, None]
        if self.plane:
            in_solid = [self.unsorted(1), self.unsorted()]
        targets = [
            runtime.to_warp(value, dtype)
            for value, dtype in zip([*found, *in_solid], [vec3, vec3, self.precision.real, vec3], strict=True)
        ]
        self.launch(
            transfer.unsort_adjoints,
            [self.search.order, position_adjoint, change, *solid_adjoint, self.plane, self.seconds],
            targets,
        )
        return *found, *in_solid, *((None, None) if self.moving is None else self.moving.adjoints)

    def unsorted(self, components: int = 3) -> Tensor:
        """An uninitialized tensor (N, components), or (N,) for one, for values in the caller's order."""
        shape = (self.count, components) if components > 1 else (self.count,)
        return torch.empty(shape, dtype=self.dtype, device=self.torch_device)

    def vectors(self, zero: bool = False) -> wp.array:
        """An array (N,) of vectors."""
        return (wp.zeros if zero else wp.empty)(self.count, dtype=self.precision.vec3, device=self.device)

    def reals(self, zero: bool = False) -> wp.array:
        """An array (N,) of numbers."""
        return (wp.zeros if zero else wp.empty)(self.count, dtype=self.precision.real, device=self.device)

    def launch(self, kernel: wp.Kernel, inputs: list[Any], outputs: list[Any]) -> None:
        """Run a kernel for every particle."""
        wp.launch(kernel, self.count, inputs, outputs, device=self.device)


class Substep:
    """The arrays of a substep, sorted by cell.

    Attributes:
        boundary: density (N,) of solid and walls, and its gradient.
        results: density, density rate, density gradient, sum of squared gradients, viscous sum and pressure (N,).
    """

    def __init__(self, frame: Frame) -> None:
        self.boundary = [frame.reals(), frame.vectors()]
        self.results = [
            frame.reals(),
            frame.reals(),
            frame.vectors(),
            frame.reals(),
            frame.vectors(),
            frame.reals(),
        ]


@dataclass(frozen=True)
class FrameRecord:
    """The last substep in the caller's order, see :class:`surfsup.sph.dfsph.Substep`.

    Attributes:
        positions: (N, 3), meters.
        density: (N,).
        density_rate: (N,), 1/s.
        density_gradient: (N, 3), 1/m.
        squared_gradient: (N,) sum of squared kernel gradients.
        boundary_density: (N,).
        boundary_gradient: (N, 3), 1/m.
        rest_density: (N,) that counts as no error.
        velocity_difference: (N, 3), m/s.
    """

    positions: Tensor
    density: Tensor
    density_rate: Tensor
    density_gradient: Tensor
    squared_gradient: Tensor
    boundary_density: Tensor
    boundary_gradient: Tensor
    rest_density: Tensor
    velocity_difference: Tensor


class DifferentiableFrame(torch.autograd.Function):
    """A frame's pressure solve as an operation of torch."""

    @staticmethod
    def forward(
        ctx: Any,
        frame: Frame,
        positions: Tensor,
        velocities: Tensor,
        distance: Tensor | None,
        normal: Tensor | None,
        matrices: Tensor | None,
        vectors: Tensor | None,
        predicted: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Positions and velocities (N, 3) at the frame's end, by an unused frame that keeps its substeps."""
        ctx.frame = frame
        ends = frame.run_on_tensors(positions, velocities, predicted, distance, normal)
        frame.factors = None  # the backward pass does not read them
        return ends

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, of_positions: Tensor, of_velocities: Tensor) -> tuple[Tensor | None, ...]:
        """Derivatives in positions, velocities, distance, normal, matrices and vectors."""
        with runtime.on_stream(of_positions.device):
            return None, *ctx.frame.backward(of_positions, of_velocities), None
