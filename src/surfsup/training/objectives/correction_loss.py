"""The loss of the corrected simulator's objective."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.learned.corrected.correction import Correction
from surfsup.learned.corrected.features import DISPLACEMENT_SCALE
from surfsup.scene import FRAME_TIME
from surfsup.sph.solver import Observation
from surfsup.training.objectives.drift import MAX_POSITION_DRIFT, MAX_VELOCITY_DRIFT, clamp_length

Frame = tuple[Tensor, Tensor]  # positions and velocities

NEAR_WEIGHT = 2.0
POSITION_RETURN = 0.3  # share of the position drift that the target of a frame corrects
SIZE_FLOOR = 0.05  # added to a frame's mean squared target, so that frames at rest do not dominate


def target_correction(observation: Observation, before: Frame, after: Frame) -> Correction:
    """The correction that leads from a state to the true velocities and by the true displacement.

    Of the position drift only the share POSITION_RETURN is corrected. Most of it is chaos that cannot be inferred from
    the state; a target without any drift teaches the model to snap back, which adds energy. Of a drift beyond the
    bounds in :mod:`.drift` only as much as of one at the bounds is corrected.

    Args:
        observation: the solver's frame, which the network corrects.
        before: true positions (N, 3) in meters and velocities (N, 3) in m/s of the same frame.
        after: the same one frame later.
    """
    position_drift = (observation.state.positions - before[0]).detach()
    velocity_drift = (observation.state.velocities - before[1]).detach()
    positions = after[0] + position_drift - POSITION_RETURN * clamp_length(position_drift, MAX_POSITION_DRIFT)
    velocities = after[1] + velocity_drift - clamp_length(velocity_drift, MAX_VELOCITY_DRIFT)
    velocity_error, position_error = velocities - observation.velocities, positions - observation.positions
    return Correction(velocity_error * FRAME_TIME / DISPLACEMENT_SCALE, position_error / DISPLACEMENT_SCALE)


def correction_loss(predicted: Correction, target: Correction, near: Tensor, weight: Tensor) -> Tensor:
    """The squared error, divided by the root of the frame's mean squared target.

    The division by the root raises the weight of calm frames without making impacts irrelevant.

    Args:
        predicted: the network's correction.
        target: the target.
        near: (N,) whether a particle is near the surface.
        weight: (N,) of each particle's error, from :func:`.drift.drift_weight`.
    """
    near_weight = torch.where(near, NEAR_WEIGHT, 1.0)
    # Without gradient: otherwise the frame before could lower the loss of this one by a larger drift.
    size = target.velocity.detach().square().sum(dim=-1).mean()
    error = near_weight * weight * squared_error(predicted, target)
    return error.sum() / near_weight.sum() / (size + SIZE_FLOOR).sqrt()


def squared_error(predicted: Correction, target: Correction) -> Tensor:
    """The squared error of the velocity plus twice that of the position, of each particle (N,)."""
    error = (predicted.velocity - target.velocity).square().sum(dim=-1)
    return error + 2 * (predicted.position - target.position).square().sum(dim=-1)
