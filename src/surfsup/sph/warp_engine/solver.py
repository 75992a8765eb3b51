"""The DFSPH solver in Warp, as :class:`surfsup.sph.solver.DfsphSolver` uses it."""

from __future__ import annotations

from functools import cache

import torch
from torch import Tensor

from surfsup.native.dispatch import needs_gradient
from surfsup.sph import dfsph
from surfsup.sph.environment import Environment
from surfsup.sph.kernel_sums import kernel_graph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.state import ParticleState
from surfsup.sph.warp_engine import runtime
from surfsup.sph.warp_engine.frame import Boundary, DifferentiableFrame, Frame, boundary_of
from surfsup.sph.warp_engine.kernels.adjoint import adjoint_kernels
from surfsup.sph.warp_engine.kernels.boundary import boundary_kernels
from surfsup.sph.warp_engine.kernels.search import search_kernels
from surfsup.sph.warp_engine.kernels.substeps import substep_kernels
from surfsup.sph.warp_engine.kernels.transfer import transfer_kernels
from surfsup.sph.warp_engine.neighbors import CAPACITY
from surfsup.sph.warp_engine.runtime import precision_of

INDEX_BYTES = 4
NUMBERS, GRADIENT_NUMBERS = 70, 190  # of a particle within a frame, without and with what its gradient reads


class WarpSolver:
    """The solver in Warp, with the last environment in the form that its kernels take."""

    def __init__(self) -> None:
        self._last: tuple[Environment, torch.dtype, torch.device, Boundary] | None = None

    def __reduce__(self) -> tuple[type[WarpSolver], tuple[()]]:
        return WarpSolver, ()

    def advance(
        self, state: ParticleState, environment: Environment, predicted: Tensor, distance: Tensor, normal: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) in meters and velocities (N, 3) in m/s one frame later, by the pressure solve alone.

        Differentiable in the state and, unless there is a boundary map, in distance and normal.

        Args:
            state: particles at the frame's start.
            environment: container, boundary map and gravity.
            predicted: (N, 3) positions after ballistic motion, meters.
            distance: (N,) of the solid there, meters.
            normal: (N, 3) of the solid there.

        Raises:
            SimulationError: a position is not finite, the particles have collapsed into a clump, or Warp cannot run.
        """
        positions, velocities = state.positions, state.velocities
        if len(positions) == 0:
            return positions, velocities
        with_gradient = needs_gradient(positions, velocities, distance, normal)
        boundary = self._boundary(environment, positions, with_gradient)
        needed = bytes_per_particle(positions.dtype, with_gradient)
        with runtime.memory_errors(len(positions), needed, positions.device), runtime.on_stream(positions.device):
            if with_gradient:
                return DifferentiableFrame.apply(positions, velocities, distance, normal, predicted.detach(), boundary)
            return Frame(positions, velocities, predicted, distance, normal, boundary).end()

    def observe(
        self, state: ParticleState, environment: Environment, predicted: Tensor, distance: Tensor, normal: Tensor
    ) -> tuple[Tensor, Tensor, dfsph.Substep]:
        """As :meth:`advance` without gradients, and the last substep.

        Raises:
            SimulationError: as :meth:`advance`.
        """
        boundary = self._boundary(environment, state.positions, False)
        with runtime.on_stream(state.positions.device):
            frame = Frame(state.positions, state.velocities, predicted, distance, normal, boundary)
            positions, velocities = frame.end()
            record = frame.record()
        neighbors = find_neighbors(0.5 * (state.positions + predicted).detach(), KERNEL_SUPPORT)
        graph = kernel_graph(record.positions, neighbors)
        fluid_gradient = record.density_gradient - record.boundary_gradient
        return (
            positions,
            velocities,
            dfsph.Substep(
                graph=graph,
                kernel_sum=(record.density - record.boundary_density) / dfsph.SELF_DENSITY - 1,
                gradient_sum=fluid_gradient / dfsph.GRADIENT_SCALE,
                squared_gradient_sum=record.squared_gradient,
                velocity_difference=record.velocity_difference,
                boundary_density=record.boundary_density,
                boundary_gradient=record.boundary_gradient,
                density_gradient=record.density_gradient,
                density_error=(record.density - record.rest_density).clamp(max=dfsph.MAX_DENSITY_ERROR),
                density_rate=record.density_rate,
            ),
        )

    def _boundary(self, environment: Environment, positions: Tensor, with_gradient: bool) -> Boundary:
        """The boundary of the environment for particles at ``positions``, with all kernels loaded."""
        load_engine(positions.dtype, str(positions.device), with_gradient)
        dtype, device = positions.dtype, positions.device
        if self._last is None or self._last[0] is not environment or self._last[1:3] != (dtype, device):
            self._last = environment, dtype, device, boundary_of(environment, precision_of(dtype), positions)
        return self._last[3]


def bytes_per_particle(dtype: torch.dtype, with_gradient: bool) -> int:
    """Memory of a frame, with one table of neighbors and one of kernel factors."""
    return CAPACITY * (INDEX_BYTES + dtype.itemsize) + (GRADIENT_NUMBERS if with_gradient else NUMBERS) * dtype.itemsize


@cache
def load_engine(dtype: torch.dtype, device: str, with_gradient: bool) -> None:
    """Compile the kernels for a precision and a device, or read them from Warp's cache.

    Raises:
        SimulationError: Warp's cache cannot be written, or a kernel fails to compile.
    """
    runtime.start(device)
    precision = precision_of(dtype)
    factories = [search_kernels, transfer_kernels, boundary_kernels, substep_kernels]
    factories += [adjoint_kernels] if with_gradient else []
    runtime.load_kernels((kernel for factory in factories for kernel in factory(precision).kernels), device)
