"""A whole frame by the solver in C++."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.native.dispatch import can_run_native, fastest_isa
from surfsup.scene import WALL_CELL
from surfsup.sph import dfsph
from surfsup.sph.boundary import density, walls
from surfsup.sph.boundary.boundary_map import NO_ROTATION
from surfsup.sph.collision import LastQuery, collision_parameters
from surfsup.sph.energy import MAX_ENERGY_GAIN
from surfsup.sph.environment import Environment
from surfsup.sph.kernel_sums import kernel_graph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.moving import no_query
from surfsup.sph.native_query import native_query
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.stability import check_pairs, max_pairs
from surfsup.sph.state import SUBSTEP_TIME, WHOLE_FRAME, FramePart, MixtureState, ParticleState


@dataclass(frozen=True)
class NativeFrame:
    """A frame computed in C++.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s.
        collided: (N,) bool, which particles collision handling moved.
        last_query: where each particle last queried the solid.
        finished: False where the energy limit was exceeded. Then neither limiter nor collision handling was applied.
        outer_work: of what moves, of surface tension and adhesion on the particles, mean J/kg.
    """

    positions: Tensor
    velocities: Tensor
    collided: Tensor
    last_query: LastQuery
    finished: bool
    outer_work: float = 0.0


class NativeSolver:
    """The solver in C++, with the buffers and the last query of the solid that it keeps from frame to frame.

    Args:
        isa: instruction set; by default the fastest that the processor has.
    """

    def __init__(self, isa: str | None = None) -> None:
        self.isa = isa or fastest_isa()
        self.solvers = {WHOLE_FRAME: native.Solver(solver_parameters())}
        self._last: tuple[Environment, LastQuery] | None = None
        self._moving_queries: tuple[np.ndarray, np.ndarray] | None = None

    def __reduce__(self) -> tuple[type[NativeSolver], tuple[str]]:
        return NativeSolver, (self.isa,)  # a copy has buffers of its own

    def step(
        self,
        state: ParticleState,
        environment: Environment,
        handle_collisions: bool = True,
        part: FramePart = WHOLE_FRAME,
    ) -> NativeFrame:
        """One frame, or a ``part`` of one.

        The pressure solve reads the boundary map. Only collision handling needs exact distances, and only of
        particles that may have come near the solid since their last query.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
        """
        return self._run(state, environment, handle_collisions, None, part)

    def observe(self, state: ParticleState, environment: Environment) -> tuple[NativeFrame, dfsph.Substep]:
        """One frame without energy limit and collision handling, and its last substep, for a network to correct.

        Raises:
            SimulationError: as :meth:`step`.
        """
        count = len(state.positions)
        record = tuple(
            np.empty(shape, np.float32)
            for shape in ((count, 3), (count, 8), (count, 3), count, (count, 3), count, count)
        )
        frame = self._run(state, environment, False, record)
        positions, sums, density_gradient, boundary, boundary_gradient, error, rate = map(torch.from_numpy, record)
        predicted, _ = state.ballistic(environment.gravity)
        neighbors = find_neighbors(0.5 * (state.positions + predicted), KERNEL_SUPPORT)
        graph = kernel_graph(positions, neighbors)
        return frame, dfsph.Substep(
            graph=graph,
            kernel_sum=sums[:, 0],
            gradient_sum=sums[:, 1:4],
            squared_gradient_sum=sums[:, 7],
            velocity_difference=sums[:, 4:7],
            boundary_density=boundary,
            boundary_gradient=boundary_gradient,
            density_gradient=density_gradient,
            density_error=error,
            density_rate=rate,
        )

    @torch.no_grad()
    def _run(
        self,
        state: ParticleState,
        environment: Environment,
        handle_collisions: bool,
        record: tuple[np.ndarray, ...] | None,
        part: FramePart = WHOLE_FRAME,
    ) -> NativeFrame:
        positions, velocities = state.positions.contiguous().numpy(), state.velocities.contiguous().numpy()
        count = len(positions)
        query_positions, query_distance = self._last_query(environment, count)
        new_positions, new_velocities = np.empty_like(positions), np.empty_like(positions)
        collided = np.empty(count, bool)
        boundary_map = environment.boundary_map
        moving = None
        if environment.motion is not None:
            moving = environment.motion.native(*self._last_moving_queries(environment, count))
        masses = environment.masses_of(state)
        impulses = None if environment.impulses is None else environment.impulses.native(positions, masses)
        liquid_of = state.liquids.numpy() if isinstance(state, MixtureState) else None
        result = self._solver(part).step(
            positions=positions,
            velocities=velocities,
            gravity=environment.gravity.numpy(),
            lower=environment.lower.numpy(),
            upper=environment.upper.numpy(),
            boundary_map=None if boundary_map is None else boundary_map.tables.native,
            rotation=NO_ROTATION if boundary_map is None else boundary_map.rotation,
            solid=native_query(environment),
            handle_collisions=handle_collisions,
            query_positions=query_positions,
            query_distance=query_distance,
            new_positions=new_positions,
            new_velocities=new_velocities,
            collided=collided,
            record=record,
            moving=moving,
            impulses=impulses,
            liquids=None if environment.liquid is None else (environment.liquid.native, liquid_of),
            isa=self.isa,
            threads=torch.get_num_threads(),
            max_pairs=max_pairs(count, KERNEL_SUPPORT),
        )
        check_pairs(result.pairs, count, KERNEL_SUPPORT)
        if environment.impulses is not None and impulses is not None:
            environment.impulses.add(impulses[0], environment.motion)
        last_query = LastQuery(torch.from_numpy(query_positions), torch.from_numpy(query_distance))
        self._last = environment.base, last_query
        return NativeFrame(
            torch.from_numpy(new_positions),
            torch.from_numpy(new_velocities),
            torch.from_numpy(collided),
            last_query,
            result.finished,
            result.outer_work,
        )

    def _solver(self, part: FramePart) -> native.Solver:
        """The solver of a part of a frame. Buffers are large, so only those of the latest part are kept."""
        if part not in self.solvers:
            self.solvers = {WHOLE_FRAME: self.solvers[WHOLE_FRAME], part: native.Solver(solver_parameters(part))}
        return self.solvers[part]

    def _last_moving_queries(self, environment: Environment, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Where ``count`` particles last queried what moves and the distances there; the step updates them."""
        bodies = 0 if environment.motion is None else len(environment.motion.bodies)
        known = self._last is not None and self._last[0] is environment.base
        queries = self._moving_queries if known else None
        if queries is None or queries[1].shape != (bodies, count):
            queries = self._moving_queries = no_query(bodies, count)
        return queries

    def _last_query(self, environment: Environment, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Copies of where ``count`` particles last queried the solid (N, 3), and their distances there (N,)."""
        if self._last is None or self._last[0] is not environment.base:
            return np.zeros((count, 3), np.float32), np.zeros(count, np.float32)  # so close that all query again
        last = self._last[1]
        positions, distance = last.positions.numpy().copy(), last.distance.numpy().copy()
        # If particles have entered or left: what was found at a place holds for any particle. New ones query again.
        return with_length(positions, count), with_length(distance, count)


def with_length(values: np.ndarray, count: int) -> np.ndarray:
    """The first ``count`` rows of an array, with zeros for those that it does not have."""
    if len(values) < count:
        values = np.concatenate([values, np.zeros((count - len(values), *values.shape[1:]), values.dtype)])
    return values[:count]


def can_step_native(state: ParticleState, environment: Environment) -> bool:
    """Whether the solver in C++ may take a step."""
    tensors = (state.positions, state.velocities, environment.gravity, environment.lower, environment.upper)
    if environment.motion is not None and environment.motion.requires_grad:
        return False
    return can_run_native(*tensors, module=environment.surface)


@cache
def solver_parameters(part: FramePart = WHOLE_FRAME) -> native.SolverParameters:
    """The constants of the solver for C++ code, for a frame or a part of one."""
    boundary = native.BoundaryParameters()
    boundary.distance_offset = density.DISTANCE_OFFSET
    boundary.min_distance = density.MIN_DISTANCE
    boundary.strength = density.STRENGTH
    boundary.wall_cell = WALL_CELL
    boundary.min_wall_distance = walls.MIN_WALL_DISTANCE
    boundary.fraction_start = density.MIN_DEPTH
    boundary.fraction_step = density.FRACTION_STEP
    boundary.plane_fraction = density.plane_fraction_table().astype(np.float32).tolist()

    parameters = native.SolverParameters()
    parameters.kernel_support = KERNEL_SUPPORT
    parameters.frame_time = part.seconds
    parameters.substeps = part.substeps
    parameters.self_density = dfsph.SELF_DENSITY
    parameters.divergence_relaxation = dfsph.DIVERGENCE_RELAXATION
    parameters.density_relaxation = dfsph.DENSITY_RELAXATION
    parameters.divergence_deadband = dfsph.DIVERGENCE_DEADBAND * max(1.0, part.seconds / part.substeps / SUBSTEP_TIME)
    parameters.min_squared_gradient = dfsph.MIN_SQUARED_GRADIENT
    parameters.max_density_error = dfsph.MAX_DENSITY_ERROR
    parameters.viscosity = dfsph.LAPLACIAN_FACTOR * dfsph.VISCOSITY
    parameters.viscosity_softening = dfsph.VISCOSITY_SOFTENING
    parameters.max_energy_gain = MAX_ENERGY_GAIN
    parameters.boundary = boundary
    parameters.collision = collision_parameters()
    return parameters
