"""What a search has looked at so far, and what that took."""

from __future__ import annotations

import os

import numpy as np
from torch import Tensor

from surfsup.design.parameter import Values

PATIENCE = 25  # iterations without gain after which a run ends
HARDLY = 1e-3  # of all that was gained: less is no gain


class Record:
    """The designs of a run in the order they were looked at.

    Attributes:
        rewards: of every design, the start first; after the last iteration that of the last design too.
        designs: their values by name, one dictionary a design.
        simulations: so far, those by which slopes were measured among them.
        found_after: how many there had been when each design was looked at.
        seconds: of computing.
        work: of one processor, in seconds.
    """

    def __init__(self) -> None:
        """Nothing looked at yet."""
        self.rewards: list[float] = []
        self.designs: list[dict[str, Tensor]] = []
        self.found_after: list[int] = []
        self.simulations = 0
        self.seconds = self.work = 0.0

    @property
    def settled(self) -> bool:
        """Whether the last iterations brought the best reward forward by no share worth mentioning."""
        if len(self.rewards) <= PATIENCE:
            return False
        best = max(self.rewards)
        return best - max(self.rewards[:-PATIENCE]) <= HARDLY * (best - self.rewards[0])

    @property
    def best(self) -> int:
        """The number of the design with the best reward."""
        return int(np.argmax(self.rewards))

    def note(self, reward: Tensor, values: Values) -> None:
        """Keep a design and its reward, and after how many simulations it was found."""
        self.simulations += 1
        self.found_after.append(self.simulations)
        self.designs.append({name: value.detach().clone() for name, value in values.items()})
        self.rewards.append(float(reward.detach()))


def processor_seconds() -> float:
    """What this process and its children that have ended took of the processors so far."""
    return sum(os.times()[:4])
