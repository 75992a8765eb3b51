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
from surfsup.sph.energy_bound import HALVINGS, MAX_DELTA_VELOCITY, MAX_ENERGY_GAIN
from surfsup.sph.environment import Environment
from surfsup.sph.state import WHOLE_FRAME, FramePart, ParticleState


def energy_gain(state: ParticleState, positions: Tensor, velocities: Tensor, gravity: Tensor) -> float:
    """Mechanical energy that a step from ``state`` to these positions and velocities (N, 3) adds, mean J/kg.

    The value carries no gradient.
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
    environment: Environment,
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
        environment: gravity.
        part: of a frame that the step takes.
        supplied: energy from outside, mean J/kg: the work of moving solids and of taps.
    """
    gravity = environment.gravity
    if not can_run_native(state.positions, state.velocities, positions, velocities, gravity):
        from surfsup.sph.warp_engine import energy

        return energy.limit_energy_gain(state, positions, velocities, environment.on_host.gravity, part, supplied)
    free_positions, free_velocities = state.ballistic(gravity, part)
    after = [value.detach().clone(memory_format=torch.contiguous_format) for value in (positions, velocities)]
    native.limit_energy_gain(
        state.positions.contiguous().numpy(),
        state.velocities.contiguous().numpy(),
        free_positions.contiguous().numpy(),
        free_velocities.contiguous().numpy(),
        after[0].numpy(),
        after[1].numpy(),
        gravity.contiguous().numpy(),
        MAX_ENERGY_GAIN + supplied,
        MAX_DELTA_VELOCITY,
        HALVINGS,
        environment.masses_of(state),
    )
    return after[0], after[1]
