"""The designs that a run has evaluated, and what that cost."""

from __future__ import annotations

import os

import numpy as np
from torch import Tensor

from surfsup.design.parameter import Values

PATIENCE = 25  # iterations without improvement after which a run has converged
MIN_IMPROVEMENT = 1e-3  # relative to the total gain


class DesignHistory:
    """The evaluated designs of a run, in order.

    Attributes:
        rewards: of each design; the first is the start's.
        designs: the values of each design, by name.
        simulations_at: number of simulations when each design was evaluated.
        simulations: number so far, including those of finite differences.
        wall_seconds, cpu_seconds: computing time.
    """

    def __init__(self) -> None:
        """An empty history."""
        self.rewards: list[float] = []
        self.designs: list[dict[str, Tensor]] = []
        self.simulations_at: list[int] = []
        self.simulations = 0
        self.wall_seconds = self.cpu_seconds = 0.0

    @property
    def converged(self) -> bool:
        """Whether the last iterations hardly improved the best reward."""
        if len(self.rewards) <= PATIENCE:
            return False
        best = max(self.rewards)
        return best - max(self.rewards[:-PATIENCE]) <= MIN_IMPROVEMENT * (best - self.rewards[0])

    @property
    def best(self) -> int:
        """The index of the design with the best reward."""
        return int(np.argmax(self.rewards))

    def append(self, reward: Tensor, values: Values) -> None:
        """Add a design that one simulation has evaluated."""
        self.simulations += 1
        self.simulations_at.append(self.simulations)
        self.designs.append({name: value.detach().clone() for name, value in values.items()})
        self.rewards.append(float(reward.detach()))


def process_cpu_seconds() -> float:
    """The CPU time of this process and of its finished children."""
    return sum(os.times()[:4])
