"""The DFSPH solver in Warp, as :class:`surfsup.sph.solver.DfsphSolver` uses it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import torch
from torch import Tensor

from surfsup import warp_runtime as runtime
from surfsup.errors import InputError
from surfsup.native.dispatch import needs_gradient
from surfsup.sph import dfsph
from surfsup.sph.clearance import LastQuery
from surfsup.sph.environment import Environment
from surfsup.sph.kernel_sums import kernel_graph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.liquid import LiquidForces, Mixture
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.state import SUBSTEP_TIME, WHOLE_FRAME, FramePart, ParticleState
from surfsup.sph.warp_engine.boundary import Boundary, boundary_of
from surfsup.sph.warp_engine.collision import Collisions, Contained, NearList, leave_solid, near_list
from surfsup.sph.warp_engine.contacts import resolve_contacts
from surfsup.sph.warp_engine.device_frame import DeviceFrame
from surfsup.sph.warp_engine.energy import EnergyLimiter, LimitedFrame
from surfsup.sph.warp_engine.frame import DifferentiableFrame, Frame
from surfsup.sph.warp_engine.impulses import ImpulseSums
from surfsup.sph.warp_engine.kernels.adjoint import adjoint_kernels
from surfsup.sph.warp_engine.kernels.boundary import PLANE, boundary_kernels
from surfsup.sph.warp_engine.kernels.collision import collision_kernels
from surfsup.sph.warp_engine.kernels.energy import energy_kernels
from surfsup.sph.warp_engine.kernels.liquid import liquid_kernels
from surfsup.sph.warp_engine.kernels.moving_boundary import moving_boundary_kernels
from surfsup.sph.warp_engine.kernels.search import search_kernels
from surfsup.sph.warp_engine.kernels.substeps import substep_kernels
from surfsup.sph.warp_engine.kernels.transfer import transfer_kernels
from surfsup.sph.warp_engine.liquid import LiquidStep
from surfsup.sph.warp_engine.moving_boundary import packed
from surfsup.sph.warp_engine.neighbors import CAPACITY
from surfsup.warp_runtime import precision_of

FACTORIES = (
    search_kernels,
    transfer_kernels,
    boundary_kernels,
    substep_kernels,
    adjoint_kernels,
    energy_kernels,
    collision_kernels,
    moving_boundary_kernels,
    liquid_kernels,
)
ONE_SUBSTEP = FramePart(SUBSTEP_TIME, 1)
INDEX_BYTES = 4
NUMBERS, GRADIENT_NUMBERS = 100, 260  # of a particle within a frame, without and with what its gradient reads


class Room:
    """For how many neighbors and for how many particles near the solid a frame has room; it grows where one needs more.

    Attributes:
        neighbors: of a particle.
        rows: of the list of particles near the solid on a GPU; None for a share of all.
    """

    def __init__(self) -> None:
        self.neighbors = CAPACITY
        self.rows: int | None = None

    def was_enough(self, frame: Frame, near: NearList | None = None) -> bool:
        """Whether a frame had enough room; if not, it must be repeated. Waits for the device.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
        """
        needed, had = frame.search.check(), frame.search.capacity
        self.neighbors = max(self.neighbors, needed)
        if near is None or near.counted or near.rows_in_use() <= near.rows:
            return needed <= had
        self.rows = frame.count
        return False


class WarpSolver:
    """The solver in Warp, with the arrays and the environment of its last frame."""

    def __init__(self) -> None:
        self._last: tuple[Environment, torch.dtype, torch.device, Boundary] | None = None
        self._device_frame: DeviceFrame | None = None
        self.room = Room()

    @property
    def pairs(self) -> int:
        """Neighbor pairs of the last frame without gradients. Waits for the device."""
        return 0 if self._device_frame is None else int(runtime.to_torch(self._device_frame.frame.search.summary)[0])

    def __reduce__(self) -> tuple[type[WarpSolver], tuple[()]]:
        return WarpSolver, ()

    def step(
        self,
        state: ParticleState,
        environment: Environment,
        handle_collisions: bool = True,
        part: FramePart = WHOLE_FRAME,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Positions (N, 3) in meters and velocities (N, 3) in m/s after a part of a frame, and who (N,) collided.

        Differentiable in the state, in the poses of what moves and, unless there is a boundary map, in the shape of the
        solid that stands still. The host waits for the device once, at the end.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
            InputError: Warp cannot run here, or the device has too little memory.
        """
        count, device = len(state.positions), state.positions.device
        if count == 0:
            return state.positions, state.velocities, torch.zeros(0, dtype=torch.bool, device=device)
        with_gradient = needs_gradient(state.positions, state.velocities, module=environment.surface)
        with_gradient = with_gradient or (environment.motion is not None and environment.motion.requires_grad)
        require_known(environment, with_gradient)
        boundary = self._boundary(environment, state.positions, with_gradient)
        needed = bytes_per_particle(state.positions.dtype, with_gradient)
        with runtime.memory_errors(count, needed, device), runtime.on_stream(device):
            while True:
                near = None
                sums = None if environment.impulses is None else ImpulseSums(environment, state.positions)
                if handle_collisions and environment.surface is not None and environment.motion is None:
                    near = near_list(state.positions, self.room.rows)
                if boundary.solid == PLANE or with_gradient or sums is not None or environment.liquid is not None:
                    frame, result = self._step_by_operations(
                        state, environment, boundary, near, handle_collisions, with_gradient, part, sums
                    )
                else:
                    frame, result = self._step_by_graph(state, environment, boundary, near, handle_collisions, part)
                if self.room.was_enough(frame, near):
                    if sums is not None:
                        sums.finish()
                    return result

    def _step_by_graph(
        self,
        state: ParticleState,
        environment: Environment,
        boundary: Boundary,
        near: NearList | None,
        handle_collisions: bool,
        part: FramePart,
    ) -> tuple[Frame, tuple[Tensor, Tensor, Tensor]]:
        """A frame that is recorded, but for the query of the solid by torch."""
        capacity, steps = self.room.neighbors, steps_of(environment, state.positions, part)
        if self._device_frame is None or not self._device_frame.serves(state, boundary, capacity, part):
            self._device_frame = None  # its memory first
            self._device_frame = DeviceFrame(state, environment, boundary, capacity, part, steps)
        device_frame = self._device_frame
        contained = device_frame.run(state, handle_collisions, environment.supplied_energy, steps)
        if handle_collisions and environment.motion is not None:
            return device_frame.frame, contact_result(state.positions, contained, environment)
        if near is None:
            return device_frame.frame, contained
        before, collisions = state.positions, device_frame.collisions
        result = leave_solid(collisions, before, contained, environment, None, near)
        return device_frame.frame, (result.positions, result.velocities, result.collided)

    def _step_by_operations(
        self,
        state: ParticleState,
        environment: Environment,
        boundary: Boundary,
        near: NearList | None,
        handle_collisions: bool,
        keep: bool,
        part: FramePart,
        sums: ImpulseSums | None,
    ) -> tuple[Frame, tuple[Tensor, Tensor, Tensor]]:
        """A frame of operations that torch differentiates."""
        values = [value.contiguous() for value in (state.positions, state.velocities)]
        predicted, _ = state.ballistic(environment.gravity, part)
        distance, normal = environment.distance_and_normal(predicted) if boundary.solid == PLANE else (None, None)
        steps = steps_of(environment, values[0], part)
        frame = Frame(values[0], boundary, self.room.neighbors, keep, part, steps, sums)
        if environment.liquid is not None:
            assert isinstance(environment.liquid, LiquidForces)
            motion = environment.motion
            places = None if motion is None else motion.places(part.substeps).steps()
            frame.liquid = LiquidStep(frame, environment.liquid, environment.gravity.to(values[0]), places)
        ends = DifferentiableFrame.apply(frame, *values, distance, normal, *(steps or (None, None)), predicted.detach())
        limiter = EnergyLimiter(frame.count, boundary.acceleration, frame.precision, frame.device, part)
        limiter.allow(environment.supplied_energy)
        if frame.moving is not None:
            limiter.allow_work(frame.moving.work)
        if frame.liquid is not None:
            limiter.allow_mean(frame.liquid.work)
        positions, velocities = LimitedFrame.apply(limiter, *values, *ends)
        if not handle_collisions:
            collided = torch.zeros(len(positions), dtype=torch.bool, device=positions.device)
            return frame, (positions, velocities, collided)
        if environment.motion is not None or sums is not None:
            return frame, contact_result(values[0], (positions, velocities), environment, sums)
        collisions = Collisions(environment, positions)
        contained = Contained.apply(collisions, positions, velocities)
        if near is None:
            return frame, contained
        last = None if distance is None else LastQuery(predicted.detach(), distance.detach())
        result = leave_solid(collisions, values[0], contained, environment, last, near)
        return frame, (result.positions, result.velocities, result.collided)

    def advance(
        self, state: ParticleState, environment: Environment, predicted: Tensor, distance: Tensor, normal: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) and velocities (N, 3) one frame later by the pressure solve alone, differentiable.

        Args:
            state: particles at the frame's start.
            environment: container, boundary map and gravity.
            predicted: (N, 3) positions after ballistic motion, meters.
            distance: (N,) of the solid there, meters.
            normal: (N, 3) of the solid there.

        Raises:
            SimulationError: as :meth:`step`.
        """
        if len(state.positions) == 0:
            return state.positions, state.velocities
        return self._solve(state, environment, predicted, distance, normal)[1]

    def pushed_apart(self, state: ParticleState, environment: Environment) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) and velocities (N, 3) after one substep of particles at rest without gravity.

        Raises:
            SimulationError: as :meth:`step`.
        """
        distance, normal = environment.distance_and_normal(state.positions)
        return self._solve(state, environment, state.positions, distance, normal, ONE_SUBSTEP)[1]

    def _solve(
        self,
        state: ParticleState,
        environment: Environment,
        predicted: Tensor,
        distance: Tensor,
        normal: Tensor,
        part: FramePart = WHOLE_FRAME,
    ) -> tuple[Frame, tuple[Tensor, Tensor]]:
        values = [value.contiguous() for value in (state.positions, state.velocities, distance, normal)]
        with_gradient = needs_gradient(*values)
        boundary = self._boundary(environment, values[0], with_gradient)
        needed = bytes_per_particle(values[0].dtype, with_gradient)
        with runtime.memory_errors(len(values[0]), needed, values[0].device), runtime.on_stream(values[0].device):
            while True:
                steps = steps_of(environment, values[0], part)
                frame = Frame(values[0], boundary, self.room.neighbors, with_gradient, part, steps)
                ends = DifferentiableFrame.apply(frame, *values, *(steps or (None, None)), predicted.detach())
                if self.room.was_enough(frame):
                    return frame, ends

    def observe(
        self, state: ParticleState, environment: Environment, predicted: Tensor, distance: Tensor, normal: Tensor
    ) -> tuple[Tensor, Tensor, dfsph.Substep]:
        """As :meth:`advance` without gradients, and the last substep.

        Raises:
            SimulationError: as :meth:`step`.
        """
        frame, (positions, velocities) = self._solve(state, environment, predicted, distance, normal)
        with runtime.on_stream(state.positions.device):
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
        used = with_gradient, environment.moving is not None, environment.liquid is not None
        load_engine(positions.dtype, str(positions.device), *used)
        dtype, device = positions.dtype, positions.device
        scene = environment.base
        if self._last is None or self._last[0] is not scene or self._last[1:3] != (dtype, device):
            self._last = scene, dtype, device, boundary_of(environment, precision_of(dtype), positions)
        return self._last[3]


def require_known(environment: Environment, with_gradient: bool) -> None:
    """Refuse what Warp lacks of liquids.

    Raises:
        InputError: there are several liquids, or gradients beside one.
    """
    if isinstance(environment.liquid, Mixture):
        raise InputError(
            "several liquids run in the C++ code only: on the CPU, in single precision, without gradients; use "
            "--device cpu, see 'surfsup doctor' for what the C++ code needs, or give one liquid"
        )
    if environment.liquid is not None and with_gradient:
        raise InputError("a liquid has no gradients; omit 'liquid' for the solver's own water, which has them")


def steps_of(environment: Environment, like: Tensor, part: FramePart) -> tuple[Tensor, Tensor] | None:
    """The motion in the substeps of a part of a frame as kernels read it; None where nothing moves.

    Raises:
        InputError: something moves, but the environment does not say how.
    """
    if environment.moving is None:
        return None
    if environment.motion is None:
        raise InputError(
            "the scene has solids that move, which this use of the solver does not know; omit their motion"
        )
    return packed(environment.motion.places(part.substeps).steps(), like)


def contact_result(
    before: Tensor, state: Sequence[Tensor], environment: Environment, sums: ImpulseSums | None = None
) -> tuple[Tensor, Tensor, Tensor]:
    """Positions and velocities (N, 3) of a ``state`` after collisions, and who (N,) was moved."""
    result = resolve_contacts(before, state[0], state[1], environment, sums)
    return result.positions, result.velocities, result.collided


def bytes_per_particle(dtype: torch.dtype, with_gradient: bool) -> int:
    """Memory of a frame, with one table of neighbors and one of kernel factors."""
    return CAPACITY * (INDEX_BYTES + dtype.itemsize) + (GRADIENT_NUMBERS if with_gradient else NUMBERS) * dtype.itemsize


@cache
def load_engine(dtype: torch.dtype, device: str, with_gradient: bool, moves: bool, liquid: bool) -> None:
    """Compile the kernels for a precision and a device, or read them from Warp's cache.

    Raises:
        InputError: Warp's cache cannot be written, or a kernel fails to compile.
    """
    runtime.start(device)
    precision = precision_of(dtype)
    unused = {adjoint_kernels: not with_gradient, moving_boundary_kernels: not moves, liquid_kernels: not liquid}
    factories = [factory for factory in FACTORIES if not unused.get(factory)]
    runtime.load_kernels((kernel for factory in factories for kernel in factory(precision).kernels), device)
