"""How many substeps a long step of 20 ms needs: as few as the motion and the depth of the water allow.

One iteration of DFSPH carries pressure over one kernel support at most in a substep. So water that strikes something
is compressed in proportion to its path in a substep, and water at rest trembles in proportion to its depth and to the
substep (measured, docs/log.md). Each bounds the substep. Fast water also takes the step in parts, since the neighbors
are found once for each part.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from surfsup.scene import FRAME_TIME
from surfsup.sph.state import SUBSTEP_TIME, FramePart, ParticleState

STEP_FRAMES = 4  # frames in a long step
LONG_STEP = STEP_FRAMES * FRAME_TIME
MAX_PATH = 7.5e-3  # meters in a substep, root mean square over particles
MAX_HEAD = 2e-3  # J s/kg: mean potential energy above the lowest particle, times the substep
MAX_SUBSTEP = LONG_STEP / 3
MAX_PART_PATH = 0.026  # meters between two searches for neighbors, root mean square over particles
CALM, FALLING = 0.01, 0.1  # m/s: water falls freely if its particles move together so well, and so fast
BALLISTIC = FramePart(LONG_STEP, round(LONG_STEP / SUBSTEP_TIME))


def parts_of_step(state: ParticleState, gravity: Tensor) -> list[FramePart]:
    """The parts of the long step from ``state``, each with its number of substeps, none below those of the default.

    Args:
        state: the particles at its start, at least one.
        gravity: (3,), m/s².
    """
    velocities, falls = state.velocities.numpy(), (state.positions @ gravity).numpy()
    speed = math.sqrt(np.vdot(velocities, velocities) / len(velocities))
    head = float(falls.max() - falls.mean())
    needed = math.hypot(speed / MAX_PATH, head / MAX_HEAD)  # substeps per second
    if not needed < 1 / SUBSTEP_TIME:  # also if a state is not finite, which the solver then reports
        needed = 1 / SUBSTEP_TIME
    parts = math.ceil(min(STEP_FRAMES, max(1.0, speed * LONG_STEP / MAX_PART_PATH))) if speed < math.inf else 1
    part = LONG_STEP / parts
    return [FramePart(part, math.ceil(part * max(needed, 1 / MAX_SUBSTEP) - 1e-3))] * parts


def relative_speed(velocities: Tensor) -> float:
    """The speed relative to the mean velocity, root mean square over particles, m/s."""
    mean = velocities.mean(dim=0)
    return math.sqrt(max(0.0, float(torch.linalg.vecdot(velocities, velocities).mean() - mean @ mean)))
