"""A frame of the solver in Warp, as one differentiable operation of torch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import torch
import warp as wp
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup import warp_runtime as runtime
from surfsup.scene import FRAME_TIME
from surfsup.sph.boundary.boundary_map import BoundaryMap
from surfsup.sph.boundary.density import plane_fraction_table
from surfsup.sph.boundary.shape_functions import CELL_NODES, local_coordinates
from surfsup.sph.boundary.walls import wall_cells
from surfsup.sph.environment import Environment
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS
from surfsup.sph.warp_engine.kernels.adjoint import adjoint_kernels
from surfsup.sph.warp_engine.kernels.boundary import NO_SOLID, PLANE, VOLUME_MAP, boundary_kernels
from surfsup.sph.warp_engine.kernels.substeps import substep_kernels
from surfsup.sph.warp_engine.kernels.transfer import transfer_kernels
from surfsup.sph.warp_engine.neighbors import NeighborSearch, empty_table
from surfsup.warp_runtime import Precision, precision_of


@dataclass(frozen=True)
class Boundary:
    """Container, solid and gravity as the kernels take them.

    Attributes:
        solid: ``NO_SOLID``, ``PLANE`` or ``VOLUME_MAP``.
        inputs: of ``evaluate_boundary``, from ``lower`` to ``nodes``.
        gravity: vector, m/s².
        fallen: velocity of a frame of free fall from rest, m/s.
    """

    solid: int
    inputs: list[Any]
    gravity: Any
    fallen: Any


def boundary_of(environment: Environment, precision: Precision, like: Tensor) -> Boundary:
    """The boundary of an environment, on the device and in the precision of ``like``."""
    device, dtype = like.device, like.dtype
    real, vec3 = precision.real, precision.vec3
    lower, upper, acceleration = environment.on_host
    corners = [vec3(*value.tolist()) for value in (lower, upper, wall_cells(lower, upper))]
    table, places = tables_on(precision, device, dtype)
    volume_map = boundary_kernels(precision).Map()
    if environment.boundary_map is None:
        solid = NO_SOLID if environment.surface is None else PLANE
        cell_indices, nodes = None, None
    else:
        solid = VOLUME_MAP
        fill_map(volume_map, environment.boundary_map, precision)
        *_, indices, values = environment.boundary_map.tables.on(device, dtype)
        cell_indices = runtime.to_warp(indices, wp.int32)
        nodes = runtime.to_warp(values.flatten(1), real)
    inputs = [*corners, table, solid, volume_map, places, cell_indices, nodes]
    gravity, fallen = (vec3(*value.tolist()) for value in (acceleration, FRAME_TIME * acceleration))
    return Boundary(solid, inputs, gravity, fallen)


def fill_map(struct: Any, boundary_map: BoundaryMap, precision: Precision) -> None:
    """Write the grid of a volume map into the kernels' struct."""
    tables = boundary_map.tables
    struct.lower, struct.cell = precision.vec3(*tables.lower.tolist()), precision.vec3(*tables.cell.tolist())
    struct.rotation = precision.mat33(*boundary_map.rotation.ravel().tolist())
    struct.resolution = wp.vec3i(*tables.resolution.tolist())


@cache
def tables_on(precision: Precision, device: torch.device, dtype: torch.dtype) -> tuple[Any, Any]:
    """The volume fractions of a plane solid, and the places of a map cell's nodes."""
    places = torch.from_numpy(local_coordinates(CELL_NODES)).to(device, dtype)
    table = torch.from_numpy(plane_fraction_table()).to(device, dtype)
    return runtime.to_warp(table, precision.real), runtime.to_warp(places, precision.vec3)


class Frame:
    """The pressure solve of a frame: its arrays, and what the backward pass reads of every substep.

    Its particles are sorted by cell. Nothing here waits for the device.

    Args:
        like: (N, 3) particles; device and precision of all arrays.
        boundary: container, solid and gravity.
        capacity: neighbors of a particle for which there is room.
        keep: whether to keep what the backward pass reads.
        substeps: number of them; their duration stays.
    """

    def __init__(
        self, like: Tensor, boundary: Boundary, capacity: int, keep: bool = False, substeps: int = SUBSTEPS
    ) -> None:
        self.precision = precision_of(like.dtype)
        self.boundary, self.keep, self.substep_count = boundary, keep, substeps
        self.plane = int(boundary.solid == PLANE)
        self.count, self.dtype, self.torch_device = len(like), like.dtype, like.device
        self.device = runtime.to_warp(like, self.precision.vec3).device
        self.gravity = boundary.gravity
        self.solid = [self.vectors(), self.reals(), self.vectors()] if self.plane else [None, None, None]
        self.near_solid = wp.empty(self.count, dtype=int, device=self.device)
        self.rest_density = self.reals()
        self.delta_velocity, self.delta_position = self.vectors(), self.vectors()
        # Positions and velocities from substep to substep; without gradients two sets take turns.
        self.motions = [[self.vectors(), self.vectors()] for _ in range(substeps + 1 if keep else 2)]
        self.substeps = [Substep(self) for _ in range(substeps if keep else 1)]
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
        for number in range(self.substep_count):
            self.run_substep(number)
        self.launch(
            transfer.finish_particles,
            [
                self.search.order,
                predicted,
                velocities,
                self.boundary.fallen,
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
        self.launch(boundary_kernel, [motion[0], *self.solid, *self.boundary.inputs], substep.boundary)
        self.launch(
            kernels.compute_pressures,
            [*motion, *neighbors, *substep.boundary, self.near_solid, self.gravity, number],
            [self.rest_density, self.factors, *substep.results],
        )
        density, _, density_gradient, _, viscous, pressure = substep.results
        self.launch(
            kernels.apply_pressures,
            [*motion, *neighbors, self.factors, pressure, density, density_gradient, viscous, self.gravity, number],
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
        """Derivatives in positions, velocities, distance and normal, from those in the frame's end."""
        kernels, transfer = adjoint_kernels(self.precision), transfer_kernels(self.precision)
        boundary_kernel = boundary_kernels(self.precision).evaluate_boundary
        vec3 = self.precision.vec3
        real, rest = self.precision.real, [self.near_solid, self.rest_density]
        time = real(SUBSTEP_TIME)
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
                [*motion, *neighbors, substep.boundary[1], *rest, *substep.results, self.gravity, number, change],
                [rest_adjoint, *sums, of_boundary, of_boundary_gradient],
            )
            through_boundary = self.vectors(zero=True)
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
            [self.search.order, position_adjoint, change, *solid_adjoint, self.plane, self.precision.real(FRAME_TIME)],
            targets,
        )
        return *found, *in_solid

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
        """Derivatives in positions, velocities, distance and normal."""
        with runtime.on_stream(of_positions.device):
            return None, *ctx.frame.backward(of_positions, of_velocities), None
