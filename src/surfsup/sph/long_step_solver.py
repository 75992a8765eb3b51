"""The solver in long steps: 2.5 times as fast as the default, somewhat less accurate (docs/log.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.environment import Environment
from surfsup.sph.fast_frames import frame_parts
from surfsup.sph.interpolation import hermite
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.long_steps import BALLISTIC, CALM, FALLING, LONG_STEP, STEP_FRAMES, parts_of_step, relative_speed
from surfsup.sph.native_solver import can_step_native
from surfsup.sph.simulator import Simulator
from surfsup.sph.solver import DfsphSolver, finished
from surfsup.sph.state import ParticleState


@dataclass(frozen=True)
class LongStepState:
    """The particles at a frame within a long step.

    Attributes:
        positions: (N, 3), meters.
        velocities: (N, 3), m/s.
        ends: the particles at the start and the end of the step, or None at the start of the next.
        passed: frames since the step's start.
    """

    positions: Tensor
    velocities: Tensor
    ends: tuple[ParticleState, ParticleState] | None = None
    passed: int = 0


class LongStepSolver(Simulator[LongStepState]):
    """Advances particles by steps of 0.02 s (:mod:`surfsup.sph.long_steps`), four frames of 0.005 s.

    The frames within a step are interpolated by cubic Hermite splines and moved out of the solid. A long step that
    begins with very fast water (:mod:`surfsup.sph.fast_frames`) is one of four frames of the default solver.

    Runs in C++ only. Knows neither moving solids nor taps nor liquids, and measures no forces.
    """

    history_length: ClassVar[int] = 0  # of the reference's frames

    def __init__(self) -> None:
        self.solver = DfsphSolver()

    def initial_state(self, positions: Tensor, velocities: Tensor, environment: Environment) -> LongStepState:
        """The state of particles (N, 3) at the start of a scene."""
        return LongStepState(positions, velocities)

    def state_from_frames(self, positions: Tensor, velocities: Tensor) -> LongStepState:
        """The state at one frame (1, N, 3); a long step begins there."""
        return LongStepState(positions[0], velocities[0])

    def step(
        self, state: LongStepState, environment: Environment, handle_collisions: bool = True
    ) -> tuple[LongStepState, Tensor]:
        """The state one frame later, and which particles (N,) collision handling moved.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
            InputError: the C++ code cannot run.
        """
        begin = ParticleState(state.positions, state.velocities)
        if state.ends is None:
            end, collided = self.long_step(begin, environment, handle_collisions)
        else:
            begin, end = state.ends
            collided = torch.zeros(len(begin.positions), dtype=torch.bool)
        passed = state.passed + 1
        if passed == STEP_FRAMES:
            return LongStepState(end.positions, end.velocities), collided
        ends = (begin.positions, begin.velocities), (end.positions, end.velocities)
        positions, velocities = hermite(*ends, passed / STEP_FRAMES, LONG_STEP)
        if handle_collisions:
            result = resolve_collisions(state.positions, positions, velocities, environment)
            positions, velocities, collided = result.positions, result.velocities, result.collided | collided
        return LongStepState(positions, velocities, (begin, end), passed), collided

    def long_step(
        self, state: ParticleState, environment: Environment, handle_collisions: bool = True
    ) -> tuple[ParticleState, Tensor]:
        """The particles after a long step, and which (N,) collision handling moved in it.

        Raises:
            SimulationError: as :meth:`step`.
            InputError: as :meth:`step`.
        """
        native = self.solver.native
        if native is None or not can_step_native(state, environment):
            raise InputError(
                "long steps run in the C++ code only: on the CPU, in single precision, without gradients; use --device "
                "cpu, see 'surfsup doctor' for what the C++ code needs, or take the simulator dfsph"
            )
        collided = torch.zeros(len(state.positions), dtype=torch.bool)
        if (fallen := free_fall(state, environment)) is not None:
            return fallen, collided
        if len(state.positions) == 0 or frame_parts(state.velocities) > 1:
            for _ in range(STEP_FRAMES):
                state, here = self.solver.step(state, environment, handle_collisions)
                collided |= here
            return state, collided
        for part in parts_of_step(state, environment.gravity):
            frame = native.step(state, environment, handle_collisions, part)
            state, here = finished(state, frame, environment, handle_collisions, part)
            collided |= here
        return state, collided


def free_fall(state: ParticleState, environment: Environment) -> ParticleState | None:
    """The particles after a long step if they fall together, far from walls and solid; otherwise None.

    Water that falls as a block has no pressure, so its motion is known without the solver.
    """
    if len(state.positions) == 0 or float(torch.linalg.vector_norm(state.velocities[0])) < FALLING:
        return None
    if relative_speed(state.velocities) > CALM:
        return None
    positions, velocities = state.ballistic(environment.gravity, BALLISTIC)
    lower, upper = environment.lower + KERNEL_SUPPORT, environment.upper - KERNEL_SUPPORT
    if not all(bool(((place > lower) & (place < upper)).all()) for place in (state.positions, positions)):
        return None
    path = float(torch.linalg.vector_norm(positions - state.positions, dim=-1).max())
    if float(environment.distance_and_normal(state.positions)[0].min()) < KERNEL_SUPPORT + path:
        return None
    return ParticleState(positions, velocities)
