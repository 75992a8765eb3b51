"""A frame among solids that move, in one piece or in several.

The number of pieces follows from the motion of the solids alone. Fast water gets no more substeps here, as it would
among solids that stand still (:mod:`surfsup.sph.fast_frames`): in a gap that closes they made squeezed water faster.
"""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.scene import FRAME_TIME
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.energy import limit_energy_gain
from surfsup.sph.environment import Environment
from surfsup.sph.native_solver import NativeSolver, can_step_native
from surfsup.sph.state import SUBSTEPS, FramePart, ParticleState


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
    substeps = max(1, round(SUBSTEPS * motion.seconds / FRAME_TIME / len(pieces)))
    collided = torch.zeros(len(state.positions), dtype=torch.bool)
    for piece in pieces:
        part = FramePart(piece.seconds, substeps)
        state, here = step_part(solver, state, environment.moved(piece), handle_collisions, part)
        collided |= here
    return state, collided


def step_part(
    solver: NativeSolver, state: ParticleState, environment: Environment, handle_collisions: bool, part: FramePart
) -> tuple[ParticleState, Tensor]:
    """The state after a part of a frame, and which particles (N,) collision handling moved."""
    frame = solver.step(state, environment, handle_collisions, part)
    if frame.finished:
        return replace(state, positions=frame.positions, velocities=frame.velocities), frame.collided
    supplied = frame.outer_work + environment.supplied_energy
    positions, velocities = limit_energy_gain(state, frame.positions, frame.velocities, environment, part, supplied)
    if not handle_collisions:
        return replace(state, positions=positions, velocities=velocities), frame.collided
    masses = environment.masses_of(state)
    result = resolve_collisions(state.positions, positions, velocities, environment, masses=masses)
    return replace(state, positions=result.positions, velocities=result.velocities), result.collided
