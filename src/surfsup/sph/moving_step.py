"""A frame among solids that move, in one piece or in several."""

from __future__ import annotations

from functools import cache

import torch
from torch import Tensor

from surfsup import native
from surfsup.errors import InputError
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.energy import limit_energy_gain
from surfsup.sph.environment import Environment
from surfsup.sph.moving import FrameMotion
from surfsup.sph.native_solver import NativeSolver, can_step_native, solver_parameters
from surfsup.sph.state import SUBSTEPS, ParticleState


def step_among_moving(
    solver: NativeSolver | None, state: ParticleState, environment: Environment, handle_collisions: bool
) -> tuple[ParticleState, Tensor]:
    """The state one frame later, and which particles (N,) collision handling moved.

    Raises:
        InputError: a gradient, a GPU, double precision or a package without C++ code.
        SimulationError: as for a frame among solids that stand still.
    """
    motion = environment.motion
    if motion is None:
        raise InputError(
            "the scene has solids that move, which this use of the solver does not know; omit their motion"
        )
    if solver is None or not can_step_native(state, environment):
        raise InputError(
            "moving solids run in the C++ code only: on the CPU, in single precision, without gradients; "
            "use --device cpu, and see 'surfsup doctor' for what the C++ code needs"
        )
    pieces = motion.pieces()
    collided = torch.zeros(len(state.positions), dtype=torch.bool)
    for piece in pieces:
        moved = environment.moved(piece)
        state, here = step_piece(solver, state, moved, piece, len(pieces), handle_collisions)
        collided |= here
    return state, collided


def step_piece(
    solver: NativeSolver,
    state: ParticleState,
    environment: Environment,
    motion: FrameMotion,
    pieces: int,
    handle_collisions: bool,
) -> tuple[ParticleState, Tensor]:
    """The state after one of the ``pieces`` of a frame, and which particles (N,) collision handling moved."""
    engine = None if pieces == 1 else piece_solver(max(1, SUBSTEPS // pieces), motion.seconds)
    frame = solver.step(state, environment, handle_collisions, engine)
    if frame.finished:
        return ParticleState(frame.positions, frame.velocities), frame.collided
    gravity, substeps = environment.gravity, SUBSTEPS if engine is None else max(1, SUBSTEPS // pieces)
    fall = (substeps + 1) / (2 * substeps) * motion.seconds**2 * gravity
    ballistic = state.positions + motion.seconds * state.velocities + fall, state.velocities + motion.seconds * gravity
    positions, velocities = limit_energy_gain(
        state, frame.positions, frame.velocities, gravity, frame.solid_work, ballistic
    )
    if not handle_collisions:
        return ParticleState(positions, velocities), frame.collided
    result = resolve_collisions(state.positions, positions, velocities, environment)
    return ParticleState(result.positions, result.velocities), result.collided


@cache
def piece_solver(substeps: int, seconds: float) -> native.Solver:
    """The solver for pieces of that many substeps and seconds."""
    return native.Solver(solver_parameters(substeps, seconds))
