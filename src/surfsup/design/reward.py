"""What a design is to reach, as a number of where the water is in the end; more is better.

The densities are those of section 7.1 of the SURFSUP supplement, the mean over the particles of the logarithm.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.errors import InputError


@dataclass(frozen=True)
class Outcome:
    """How a rollout ended.

    Attributes:
        positions: (N, 3) of all particles in meters; where it landed for one that reached the floor and so left.
        landed: (N,) bool, who did.
        parameters: the design that made it, by name.
    """

    positions: Tensor
    landed: Tensor
    parameters: Mapping[str, Tensor]


FADING = 0.04  # meters above the floor in which a particle's share of the smooth mean falls to a third

Reward = Callable[[Outcome], Tensor]


def near(center: Sequence[float], variance: float) -> Reward:
    """The mean log density of N(``center``, ``variance``) at the places of all particles: the bowl's reward.

    Args:
        center: (3,), meters.
        variance: in m², the same in every direction.
    """

    def reward(end: Outcome) -> Tensor:
        return log_density(end.positions, center, variance).mean()

    return reward


def landing_near(center: Sequence[float], variance: float, floor: float) -> Reward:
    """The mean log density of N(``center``, ``variance``) over the floor where particles landed: the funnel's reward.

    A wider spout lets more particles land in time, but that a particle comes to count is a step, which has no gradient.
    So the gradient, and only that, is of the mean in which those in the air count too, the less the higher they are.

    Args:
        center: (2,), meters.
        variance: in m², the same in every direction.
        floor: height in meters at which particles land.

    Raises:
        NothingLanded: no particle has, so there is no such mean.
    """

    def reward(end: Outcome) -> Tensor:
        if not bool(end.landed.any()):
            raise NothingLanded(
                "no particle reached the floor, so the reward is undefined; give more --frames, or a start whose hole "
                "lets water through"
            )
        density = log_density(end.positions[:, :2], center, variance)
        share = torch.exp(-(end.positions[:, 2] - floor).clamp(min=0) / FADING)
        smooth = (share * density).sum() / share.sum()
        return density[end.landed].mean().detach() + smooth - smooth.detach()

    return reward


class NothingLanded(InputError):
    """A reward over landed particles has none to look at."""


def log_density(places: Tensor, center: Sequence[float], variance: float) -> Tensor:
    """The log density (N,) of a normal distribution around ``center`` (D,) at ``places`` (N, D)."""
    squared = (places - places.new_tensor(center)).square().sum(dim=-1)
    return -squared / (2 * variance) - places.shape[1] / 2 * math.log(2 * math.pi * variance)
