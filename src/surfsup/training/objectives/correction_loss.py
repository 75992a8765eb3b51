"""What the correction objective asks of a predicted frame."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.learned.corrected.correction import Correction
from surfsup.learned.corrected.features import DISPLACEMENT_SCALE
from surfsup.learned.corrected.simulator import Observation
from surfsup.sph.state import FRAME_TIME
from surfsup.training.objectives.strayed import FARTHEST, FASTEST, at_most

Frame = tuple[Tensor, Tensor]  # positions and velocities

NEAR_WEIGHT = 2.0
RETURN = 0.3  # of the distance strayed from the truth that a frame is asked to make good
FLOOR = 0.05  # of a frame's mean squared correction: keeps frames at rest from dominating
CALM = 0.1  # of a correction's unit: errors below count for nothing in the calm term


def wanted_correction(seen: Observation, before: Frame, after: Frame) -> Correction:
    """The correction that would lead from ``seen`` to the true velocities and by the true displacement.

    Where the state has strayed from the truth its place is asked to return only by a part: how far it strayed is mostly
    chaos that no state tells, and asking for all of it teaches the model to snap back, which pumps energy in. Where
    it has strayed far it is asked no more than if it had strayed a little (:mod:`.strayed`).

    Args:
        seen: what the network saw.
        before: true positions (N, 3) in meters and velocities (N, 3) in m/s of the frame that was seen.
        after: the same one frame later.
    """
    strayed = (seen.state.positions - before[0]).detach()
    off = (seen.state.velocities - before[1]).detach()
    goal = after[0] + strayed - RETURN * at_most(strayed, FARTHEST)
    velocities = after[1] + off - at_most(off, FASTEST)
    missing = velocities - seen.speeds
    return Correction(missing * FRAME_TIME / DISPLACEMENT_SCALE, (goal - seen.places) / DISPLACEMENT_SCALE)


def motion_loss(predicted: Correction, wanted: Correction, near: Tensor, sure: Tensor) -> Tensor:
    """Squared error of velocity and, twice, of position, over the root of the frame's own size.

    Dividing by the root lets calm frames count without letting them drown the impacts.

    Args:
        predicted: by the network.
        wanted: the truth.
        near: (N,) whether a particle is within NEAR_SURFACE_DISTANCE of the solid.
        sure: (N,) what a particle's truth still says of it, 0 to 1 (:func:`.strayed.weight_of`).
    """
    error = squared_error(predicted, wanted)
    weight = torch.where(near, NEAR_WEIGHT, 1.0)
    # Without a gradient: else a frame could be made to look easier by straying further in the one before.
    size = wanted.velocity.detach().square().sum(dim=-1).mean()
    return (weight * sure * error).sum() / weight.sum() / (size + FLOOR).sqrt()


def calm_loss(predicted: Correction, wanted: Correction, sure: Tensor) -> Tensor:
    """Logarithm of the squared error, so that halving a small one is worth as much as halving a large one.

    Beside an impact a fall and a pool at rest weigh nothing in a squared error. But they last: hundredths of a
    millimeter a frame on the way down are millimeters at the impact, and these decide where the splash goes.
    """
    return (sure * torch.log1p(squared_error(predicted, wanted) / CALM**2)).mean()


def squared_error(predicted: Correction, wanted: Correction) -> Tensor:
    """Squared error of velocity and, twice, of position, of each particle (N,)."""
    error = (predicted.velocity - wanted.velocity).square().sum(dim=-1)
    return error + 2 * (predicted.position - wanted.position).square().sum(dim=-1)
