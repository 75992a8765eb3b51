"""Rewards: the objective of a design, a number computed from where the water ends.

The densities are those of section 7.1 of the SURFSUP supplement: means of a log density over the particles.
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
    """The end of a rollout.

    Attributes:
        positions: (N, 3) of all particles, meters; the landing position of those that have landed.
        landed: (N,) bool, which particles have reached the floor and left the simulation.
        parameters: values of the design, by name.
    """

    positions: Tensor
    landed: Tensor
    parameters: Mapping[str, Tensor]


DECAY_HEIGHT = 0.04  # meters above the floor over which a particle's weight in the smooth mean falls to 1/e

Reward = Callable[[Outcome], Tensor]


def near(center: Sequence[float], variance: float) -> Reward:
    """The reward of the bowl: the mean log density of N(``center``, ``variance``) at all particles.

    Args:
        center: (3,), meters.
        variance: m², the same in every direction.
    """

    def reward(end: Outcome) -> Tensor:
        return log_density(end.positions, center, variance).mean()

    return reward


def landing_near(center: Sequence[float], variance: float, floor: float) -> Reward:
    """The reward of the funnel: the mean log density of N(``center``, ``variance``) at the landed particles.

    A wider spout lets more particles land in time, but whether a particle has landed is a step function without
    gradient. Therefore the gradient, not the value, is that of a smooth mean that includes the particles in the air,
    with a weight that decreases with their height.

    Args:
        center: (2,), meters.
        variance: m², the same in both directions.
        floor: height at which particles land, meters.

    Raises:
        NothingLanded: no particle has landed, so the mean is undefined.
    """

    def reward(end: Outcome) -> Tensor:
        if not bool(end.landed.any()):
            raise NothingLanded(
                "no particle reached the floor, so the reward is undefined; use more --frames, or a start with a wider "
                "hole"
            )
        density = log_density(end.positions[:, :2], center, variance)
        weight = torch.exp(-(end.positions[:, 2] - floor).clamp(min=0) / DECAY_HEIGHT)
        smooth = (weight * density).sum() / weight.sum()
        return density[end.landed].mean().detach() + smooth - smooth.detach()

    return reward


class NothingLanded(InputError):
    """A reward over landed particles is undefined because none has landed."""


def log_density(points: Tensor, center: Sequence[float], variance: float) -> Tensor:
    """The log density (N,) of an isotropic normal distribution around ``center`` (D,) at ``points`` (N, D)."""
    squared = (points - points.new_tensor(center)).square().sum(dim=-1)
    return -squared / (2 * variance) - points.shape[1] / 2 * math.log(2 * math.pi * variance)
