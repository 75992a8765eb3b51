"""Training noise: a random walk over the history, like the error that a rollout accumulates."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.learned.message_passing.history import History


def add_random_walk(history: History, std: float, generator: torch.Generator) -> History:
    """Add a random walk to the displacements, and its sum to the positions.

    Source: GNS (Sanchez-Gonzalez et al. 2020), ``noise_utils.py`` of its code.

    Args:
        history: the true history; it is not modified.
        std: standard deviation of the walk at the latest displacement, meters. The oldest position stays exact.
        generator: of the random numbers.
    """
    count, steps, _ = history.displacements.shape
    draws = torch.randn(count, steps, 3, generator=generator, device=generator.device)
    walk: Tensor = (draws.to(history.displacements) * (std / steps**0.5)).cumsum(dim=1)
    return History(history.positions + walk.sum(dim=1), history.velocities, history.displacements + walk.flip(1))
