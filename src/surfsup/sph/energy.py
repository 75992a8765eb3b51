"""Water among walls and solids that stand still only ever loses mechanical energy: a law that no step may break.

In the reference solver's truth it falls in every frame of every scene that was looked at; a network keeps to that by
itself, but for the frames in which it is at a loss and throws particles about.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup import native
from surfsup.learned.corrected.correction import LARGEST, Correction
from surfsup.learned.corrected.features import DISPLACEMENT_SCALE
from surfsup.sph.state import FRAME_TIME, ParticleState

GAIN = 2e-3  # J/kg a frame: what a sound model gains now and then, of the 5 to 15 that a scene begins with
HALVINGS = 10


def energy_gain(state: ParticleState, positions: Tensor, velocities: Tensor, gravity: Tensor) -> float:
    """How much mechanical energy a step from ``state`` to these positions and velocities (N, 3) adds, mean J/kg.

    It decides what is done, and no gradient goes through it; so in single precision on the CPU it is added up in C++,
    whose one thread is done before torch's have woken up.
    """
    step = [value.detach() for value in (state.positions, state.velocities, positions, velocities, gravity)]
    if native.instruction_sets() and all(value.device.type == "cpu" and value.dtype == torch.float32 for value in step):
        return native.energy_gain(*(value.contiguous().numpy() for value in step))
    before, speed_before, after, speed_after, pull = step
    kinetic = ((speed_after - speed_before) * (speed_after + speed_before)).sum(dim=-1) / 2
    return float((kinetic - ((after - before) * pull).sum(dim=-1)).sum()) / max(1, len(after))


def without_gain(state: ParticleState, positions: Tensor, velocities: Tensor, gravity: Tensor) -> tuple[Tensor, Tensor]:
    """Positions and velocities (N, 3) of a step from ``state``, its corrections cut back until no energy is gained.

    The largest are cut first, at half of the bound each time, for those are what tears the water apart: the others
    stay as they are. With none left it is ballistic motion, which gains nothing. What is no number stays so.

    Args:
        state: before the step.
        positions: after it, meters.
        velocities: after it, m/s.
        gravity: (3,), m/s².
    """
    if not energy_gain(state, positions, velocities, gravity) > GAIN:
        return positions, velocities
    ahead, falling = state.ballistic(gravity)
    correction = Correction(
        (velocities - falling) * (FRAME_TIME / DISPLACEMENT_SCALE), (positions - ahead) / DISPLACEMENT_SCALE
    )
    for halving in range(1, HALVINGS + 1):
        less = correction.bounded(LARGEST / 2**halving)
        positions, velocities = less.added_to(ahead, falling)
        if energy_gain(state, positions, velocities, gravity) <= GAIN:
            return positions, velocities
    return ahead, falling
