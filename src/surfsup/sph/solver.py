"""The DFSPH solver: the default simulator."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import torch
from torch import Tensor

from surfsup.native.dispatch import is_built
from surfsup.scene import FRAME_TIME
from surfsup.sph.collision import LastQuery, resolve_collisions
from surfsup.sph.dfsph import Substep
from surfsup.sph.energy import limit_energy_gain
from surfsup.sph.environment import Environment
from surfsup.sph.fast_frames import frame_parts
from surfsup.sph.moving_step import step_among_moving
from surfsup.sph.native_solver import NativeFrame, NativeSolver, can_step_native
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import WHOLE_FRAME, FramePart, ParticleState

if TYPE_CHECKING:
    from surfsup.sph.warp_engine.solver import WarpSolver


# A displacement by pressure alone does not depend on the time that it takes. In a second its energy is within bounds.
ONE_SUBSTEP = FramePart(seconds=1.0, substeps=1)


@dataclass(frozen=True)
class Observation:
    """A frame by the pressure solve alone, before energy limit and collision handling.

    Attributes:
        state: the particles at the frame's start.
        positions: (N, 3) at its end, meters.
        velocities: (N, 3) at its end, m/s.
        delta_position: (N, 3) against ballistic motion, meters.
        delta_velocity: (N, 3) against ballistic motion, m/s.
        last_query: where the particles queried the solid.
        substep: the last substep.
    """

    state: ParticleState
    positions: Tensor
    velocities: Tensor
    delta_position: Tensor
    delta_velocity: Tensor
    last_query: LastQuery
    substep: Substep


class DfsphSolver(Simulator[ParticleState]):
    """Advances particles by frames of 0.005 s with five DFSPH substeps each (:mod:`surfsup.sph.dfsph`).

    In C++ a frame of very fast water has a multiple of five substeps (:mod:`surfsup.sph.fast_frames`), but not where
    something moves: there the speed of the solids alone cuts a frame (:mod:`surfsup.sph.moving_step`).

    Runs in C++ on CPUs in single precision where no gradient is needed, and in Warp otherwise: with gradients in
    positions, velocities and the shape of the solid, in double precision, on GPUs, and on CPUs without the C++ code.
    Both agree to rounding.
    """

    knows_moving_solids: ClassVar[bool] = True
    knows_taps: ClassVar[bool] = True
    knows_liquids: ClassVar[bool] = True
    measures_forces: ClassVar[bool] = True
    history_length: ClassVar[int] = 0  # positions and end-of-frame velocities are the whole state

    def __init__(self) -> None:
        self.native = NativeSolver() if is_built() else None

    @cached_property
    def warp(self) -> WarpSolver:
        """The solver in Warp, which is imported where it is needed first."""
        from surfsup.sph.warp_engine.solver import WarpSolver

        return WarpSolver()

    def initial_state(self, positions: Tensor, velocities: Tensor, environment: Environment) -> ParticleState:
        """The state of particles (N, 3) at the start of a scene."""
        return ParticleState(positions, velocities)

    def state_from_frames(self, positions: Tensor, velocities: Tensor) -> ParticleState:
        """The state at one frame (1, N, 3)."""
        return ParticleState(positions[0], velocities[0])

    def step(
        self, state: ParticleState, environment: Environment, handle_collisions: bool = True
    ) -> tuple[ParticleState, Tensor]:
        """The state one frame later, and which particles (N,) collision handling moved.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
            InputError: there are several liquids or gradients beside a liquid, and the C++ code cannot run.
        """
        if environment.moving is not None:
            return step_among_moving(self._step_part, state, environment, handle_collisions)
        in_cpp = self.native is not None and can_step_native(state, environment)
        if in_cpp and (parts := frame_parts(state.velocities)) > 1:
            return self._step_in_parts(state, environment, handle_collisions, parts)
        return self._step_part(state, environment, handle_collisions, WHOLE_FRAME)

    def _step_part(
        self, state: ParticleState, environment: Environment, handle_collisions: bool, part: FramePart
    ) -> tuple[ParticleState, Tensor]:
        """The state after a part of a frame, and which particles (N,) collision handling moved."""
        if self.native is not None and can_step_native(state, environment):
            frame = self.native.step(state, environment, handle_collisions, part)
            return finished(state, frame, environment, handle_collisions, part)
        positions, velocities, collided = self.warp.step(state, environment, handle_collisions, part)
        return replace(state, positions=positions, velocities=velocities), collided

    def _step_in_parts(
        self, state: ParticleState, environment: Environment, handle_collisions: bool, parts: int
    ) -> tuple[ParticleState, Tensor]:
        """A frame of fast water (:mod:`surfsup.sph.fast_frames`)."""
        part = FramePart(FRAME_TIME / parts)
        moved = torch.zeros(len(state.positions), dtype=torch.bool)
        for _ in range(parts):
            state, collided = self._step_part(state, environment, handle_collisions, part)
            moved |= collided
        return state, moved

    def pushed_apart(self, positions: Tensor, environment: Environment) -> Tensor:
        """Where the pressure of one substep moves particles at rest at ``positions`` (N, 3), out of solid and walls.

        Args:
            positions: meters.
            environment: without gravity.

        Raises:
            SimulationError: as :meth:`step`.
        """
        state = ParticleState(positions, torch.zeros_like(positions))
        if self.native is not None and can_step_native(state, environment):
            return self.native.step(state, environment, part=ONE_SUBSTEP).positions
        apart, speeds = self.warp.pushed_apart(state, environment)
        return resolve_collisions(positions, apart, speeds, environment, None).positions

    def observe(self, state: ParticleState, environment: Environment) -> Observation:
        """The frame by the pressure solve alone, and its last substep, without gradients.

        Raises:
            SimulationError: as :meth:`step`.
        """
        predicted, falling = state.ballistic(environment.gravity)
        if self.native is not None and can_step_native(state, environment):
            frame, substep = self.native.observe(state, environment)
            delta_position, delta_velocity = frame.positions - predicted, frame.velocities - falling
            return Observation(
                state, frame.positions, frame.velocities, delta_position, delta_velocity, frame.last_query, substep
            )
        with torch.no_grad():
            distance, normal = environment.distance_and_normal(predicted)
            positions, velocities, substep = self.warp.observe(state, environment, predicted, distance, normal)
        last_query = LastQuery(predicted, distance)
        delta_position, delta_velocity = positions - predicted, velocities - falling
        return Observation(state, positions, velocities, delta_position, delta_velocity, last_query, substep)


def finished(
    state: ParticleState,
    frame: NativeFrame,
    environment: Environment,
    handle_collisions: bool,
    part: FramePart = WHOLE_FRAME,
) -> tuple[ParticleState, Tensor]:
    """The state after a frame in C++, and which particles (N,) were moved, with :func:`finish_step` where needed."""
    if frame.finished:
        return replace(state, positions=frame.positions, velocities=frame.velocities), frame.collided
    return finish_step(
        state,
        frame.positions,
        frame.velocities,
        environment,
        frame.last_query,
        handle_collisions,
        part,
        frame.outer_work,
    )


def finish_step(
    state: ParticleState,
    positions: Tensor,
    velocities: Tensor,
    environment: Environment,
    last_query: LastQuery | None,
    handle_collisions: bool,
    part: FramePart = WHOLE_FRAME,
    outer_work: float = 0.0,
) -> tuple[ParticleState, Tensor]:
    """The state after energy limit and, if requested, collision handling, and which particles (N,) were moved.

    Args:
        state: before the step.
        positions: (N, 3) after it, meters.
        velocities: (N, 3) after it, m/s.
        environment: gravity, container and solid.
        last_query: where the particles queried the solid within the step.
        handle_collisions: whether to move particles out of solid and walls.
        part: of a frame that the step takes.
        outer_work: of surface tension and adhesion, mean J/kg.
    """
    supplied = environment.supplied_energy + outer_work
    positions, velocities = limit_energy_gain(state, positions, velocities, environment, part, supplied)
    if not handle_collisions:
        unmoved = torch.zeros(len(positions), dtype=torch.bool, device=positions.device)
        return replace(state, positions=positions, velocities=velocities), unmoved
    masses = environment.masses_of(state)
    result = resolve_collisions(state.positions, positions, velocities, environment, last_query, masses)
    return replace(state, positions=result.positions, velocities=result.velocities), result.collided
