"""Energy limiter: a frame adds no mechanical energy beyond a small bound.

Water among walls and solids at rest can only lose mechanical energy. In the reference it falls in every frame of
every scene that was examined. A simulator may fail in an unusual state and accelerate particles without bound; the
limiter prevents that.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup import native
from surfsup.native.dispatch import can_run_native
from surfsup.sph.state import WHOLE_FRAME, FramePart, ParticleState

MAX_ENERGY_GAIN = 2e-3  # J/kg in a frame; valid rollouts gain this now and then, and a scene begins with 5 to 15
MAX_DELTA_VELOCITY = 5.0  # m/s in a frame; one true change in ten thousand exceeds 4.7
HALVINGS = 10


def energy_gain(state: ParticleState, positions: Tensor, velocities: Tensor, gravity: Tensor) -> float:
    """Mechanical energy that a step from ``state`` to these positions and velocities (N, 3) adds, mean J/kg.

    The value decides between branches and carries no gradient. C++ sums it on one thread, in less time than torch
    needs to wake its threads.
    """
    arrays = [value.detach() for value in (state.positions, state.velocities, positions, velocities, gravity)]
    if can_run_native(*arrays):
        return native.energy_gain(*(value.contiguous().numpy() for value in arrays))
    old_positions, old_velocities, new_positions, new_velocities, acceleration = arrays
    kinetic = ((new_velocities - old_velocities) * (new_velocities + old_velocities)).sum(dim=-1) / 2
    work = ((new_positions - old_positions) * acceleration).sum(dim=-1)
    return float((kinetic - work).sum()) / max(1, len(new_positions))


def limit_energy_gain(
    state: ParticleState,
    positions: Tensor,
    velocities: Tensor,
    gravity: Tensor,
    part: FramePart = WHOLE_FRAME,
    supplied: float = 0.0,
) -> tuple[Tensor, Tensor]:
    """A step from ``state`` with its deviations from free fall cut until it gains no energy.

    Deviations above a bound are shortened to it, smaller ones stay as they are. The bound is halved until the gain is
    small enough. If no bound suffices, the motion is ballistic, which gains nothing. NaN stays NaN.

    Args:
        state: before the step.
        positions: after it, meters.
        velocities: after it, m/s.
        gravity: (3,), m/s².
        part: of a frame that the step takes.
        supplied: energy from outside, mean J/kg: the work of moving solids.
    """
    if not energy_gain(state, positions, velocities, gravity) > MAX_ENERGY_GAIN + supplied:
        return positions, velocities
    predicted, falling = state.ballistic(gravity, part)
    delta_velocity, delta_position = velocities - falling, positions - predicted
    for halving in range(1, HALVINGS + 1):
        fraction = kept_fraction(delta_velocity, MAX_DELTA_VELOCITY / 2**halving)
        positions, velocities = predicted + fraction * delta_position, falling + fraction * delta_velocity
        if energy_gain(state, positions, velocities, gravity) <= MAX_ENERGY_GAIN + supplied:
            return positions, velocities
    return predicted, falling


def kept_fraction(vectors: Tensor, bound: float) -> Tensor:
    """The factors (N, 1), at most one, that shorten ``vectors`` (N, 3) to a length of at most ``bound``."""
    return (bound / torch.linalg.vector_norm(vectors, dim=-1, keepdim=True).clamp(min=1e-9)).clamp(max=1)
