"""A frame among solids that move, in one piece or in several.

The number of pieces follows from the motion of the solids alone. Fast water gets no more substeps here, as it would
among solids that stand still (:mod:`surfsup.sph.fast_frames`): in a gap that closes they made squeezed water faster.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.scene import FRAME_TIME
from surfsup.sph.environment import Environment
from surfsup.sph.state import SUBSTEPS, FramePart, ParticleState

StepPart = Callable[[ParticleState, Environment, bool, FramePart], tuple[ParticleState, Tensor]]


def step_among_moving(
    step_part: StepPart, state: ParticleState, environment: Environment, handle_collisions: bool
) -> tuple[ParticleState, Tensor]:
    """The state one frame later, and which particles (N,) collision handling moved.

    Args:
        step_part: the state after a part of a frame, in the environment with the motion in that part.
        state: at the frame's start.
        environment: with the motion in the frame.
        handle_collisions: whether to move particles out of solids and walls.

    Raises:
        InputError: the environment does not say how the solids move.
        SimulationError: as for a frame among solids that stand still.
    """
    motion = environment.motion
    if motion is None:
        raise InputError(
            "the scene has solids that move, which this use of the solver does not know; omit their motion"
        )
    pieces = motion.pieces()
    substeps = max(1, round(SUBSTEPS * motion.seconds / FRAME_TIME / len(pieces)))
    collided = torch.zeros(len(state.positions), dtype=torch.bool, device=state.positions.device)
    for piece in pieces:
        part = FramePart(piece.seconds, substeps)
        state, here = step_part(state, environment.moved(piece), handle_collisions, part)
        collided = collided | here
    return state, collided
