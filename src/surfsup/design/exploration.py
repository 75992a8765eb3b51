"""Rewards over the whole range of the parameters, where the search for a better design stands still.

A gradient sees a few step lengths. A search that begins on a plateau, or at a local maximum, would end there: the
funnel of the paper begins at a bound, where the reward first falls with the radius and rises again only 50 mm beyond.
Sixteen simulations without gradient cost less than one with it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from scipy.stats import qmc
from torch import Tensor

from surfsup.design.parameter_space import ParameterSpace

EXPLORED = 16  # designs
PATIENCE = 8  # designs without improvement after which the range is explored, and after as many again
UNBOUNDED = 1e4  # step lengths: a wider range counts as unbounded
REACH = 8.0  # step lengths around the best design where the range is unbounded

Score = Callable[[Tensor], float | None]


def is_due(rewards: list[float]) -> bool:
    """Whether the last designs improved nothing, for the first time or for as long again."""
    since_best = len(rewards) - 1 - int(np.argmax(rewards))
    return since_best > 0 and since_best % PATIENCE == 0


def explore(space: ParameterSpace, best: Tensor, score: Score, seed: list[int]) -> tuple[Tensor, float] | None:
    """The best of some designs that are spread evenly over the range, and its reward.

    Args:
        space: the parameters.
        best: (P,) the best design so far.
        score: the reward at a vector (P,), None where it is undefined.
        seed: of the points (a scrambled Halton sequence).

    Returns:
        None if no reward is defined.
    """
    points = qmc.Halton(len(best), rng=np.random.default_rng(seed)).random(EXPLORED)
    low, high = (space.clamp(torch.full_like(best, sign * torch.finfo(best.dtype).max / 4)) for sign in (-1, 1))
    wide = (high - low) > UNBOUNDED
    low, high = torch.where(wide, best - REACH, low), torch.where(wide, best + REACH, high)
    found = None
    for point in torch.from_numpy(points).to(best):
        vector = space.clamp(low + point * (high - low))
        reward = score(vector)
        if reward is not None and (found is None or reward > found[1]):
            found = vector, reward
    return found
