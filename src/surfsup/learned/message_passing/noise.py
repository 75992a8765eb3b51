"""Training noise: errors that have built up over the history, as those of a rollout do."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.learned.message_passing.history import History


def random_walk(history: History, size: float, generator: torch.Generator) -> tuple[History, Tensor]:
    """A history whose moves have strayed by a random walk, and where the particles have strayed to with them.

    The walk's spread is ``size`` meters at the last move; the oldest place is exact. From GNS (Sanchez-Gonzalez et al.
    2020, ``noise_utils.py`` of its code). What is given stays as it is.

    Returns:
        The noisy history, and the noise of its last move (N, 3), meters.
    """
    count, steps, _ = history.moves.shape
    draws = torch.randn(count, steps, 3, generator=generator, device=generator.device)
    walk = (draws.to(history.moves) * (size / steps**0.5)).cumsum(dim=1)
    strayed = history.positions + walk.sum(dim=1)
    return History(strayed, history.velocities, history.moves + walk.flip(1)), walk[:, -1]
