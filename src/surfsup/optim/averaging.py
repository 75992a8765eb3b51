"""The exponential moving average of the weights."""

from __future__ import annotations

import torch
from torch import nn


@torch.no_grad()
def update_average(average: nn.Module, model: nn.Module, step: int, decay: float) -> None:
    """Move the parameters of ``average`` towards those of ``model``.

    In early steps the decay is smaller, (1 + step) / (10 + step), so that the average forgets the random initial
    weights.

    Args:
        average: a copy of the model, updated in place.
        model: the model that is optimized.
        step: number of steps before the last one.
        decay: share of the old average that a step keeps.
    """
    decay = min(decay, (1 + step) / (10 + step))
    for averaged, new in zip(average.parameters(), model.parameters(), strict=True):
        averaged.lerp_(new, 1 - decay)
