"""The DFSPH solver: the default simulator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import torch
from torch import Tensor

from surfsup.native.dispatch import can_run_native, is_built
from surfsup.sph.collision import LastQuery, resolve_collisions
from surfsup.sph.dfsph import Substep
from surfsup.sph.energy import limit_energy_gain
from surfsup.sph.environment import Environment
from surfsup.sph.native_solver import NativeSolver
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import ParticleState

if TYPE_CHECKING:
    from surfsup.sph.warp_engine.solver import WarpSolver


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

    Runs in C++ on CPUs in single precision where no gradient is needed, and in Warp otherwise: with gradients in
    positions, velocities and the shape of the solid, in double precision, on GPUs, and on CPUs without the C++ code.
    Both agree to rounding.
    """

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
        """
        if self.native is not None and can_step_native(state, environment):
            frame = self.native.step(state, environment, handle_collisions)
            if frame.finished:
                return ParticleState(frame.positions, frame.velocities), frame.collided
            last = frame.last_query
            return finish_step(state, frame.positions, frame.velocities, environment, last, handle_collisions)
        positions, velocities, collided = self.warp.step(state, environment, handle_collisions)
        return ParticleState(positions, velocities), collided

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


def can_step_native(state: ParticleState, environment: Environment) -> bool:
    """Whether the solver in C++ may take a step."""
    tensors = (state.positions, state.velocities, environment.gravity, environment.lower, environment.upper)
    return can_run_native(*tensors, module=environment.surface)


def finish_step(
    state: ParticleState,
    positions: Tensor,
    velocities: Tensor,
    environment: Environment,
    last_query: LastQuery | None,
    handle_collisions: bool,
) -> tuple[ParticleState, Tensor]:
    """The state after energy limit and, if requested, collision handling, and which particles (N,) were moved.

    Args:
        state: before the step.
        positions: (N, 3) after it, meters.
        velocities: (N, 3) after it, m/s.
        environment: gravity, container and solid.
        last_query: where the particles queried the solid within the step.
        handle_collisions: whether to move particles out of solid and walls.
    """
    positions, velocities = limit_energy_gain(state, positions, velocities, environment)
    if not handle_collisions:
        return ParticleState(positions, velocities), torch.zeros(
            len(positions), dtype=torch.bool, device=positions.device
        )
    result = resolve_collisions(state.positions, positions, velocities, environment, last_query)
    return ParticleState(result.positions, result.velocities), result.collided
