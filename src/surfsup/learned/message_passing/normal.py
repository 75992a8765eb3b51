"""Quantities in units of their own spread."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

SMALLEST = 1e-9  # meters; keeps a quantity that never changes from being divided by zero


class Normal(nn.Module):
    """Mean and spread of a vector, by component; they are saved with the weights."""

    def __init__(self, spread: Sequence[float]) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(len(spread)))
        self.register_buffer("spread", torch.tensor(spread))

    def normalize(self, values: Tensor) -> Tensor:
        """(..., 3) as multiples of the spread."""
        return (values - self.mean) / self.spread

    def restore(self, values: Tensor) -> Tensor:
        """The inverse of :meth:`normalize`."""
        return values * self.spread + self.mean

    def take(self, moments: Moments) -> None:
        """Use the measured mean and spread from now on."""
        self.mean.copy_(moments.mean)
        self.spread.copy_(moments.spread.clamp(min=SMALLEST))


class Moments:
    """Mean and spread of values that come in portions."""

    def __init__(self) -> None:
        self.count = 0
        self.total = torch.zeros(3, dtype=torch.float64)
        self.squares = torch.zeros(3, dtype=torch.float64)

    def add(self, values: Tensor) -> None:
        """Count in ``values`` (..., 3)."""
        values = values.detach().double().cpu().reshape(-1, 3)
        self.count += len(values)
        self.total += values.sum(dim=0)
        self.squares += values.square().sum(dim=0)

    @property
    def mean(self) -> Tensor:
        """(3,)."""
        return self.total / self.count

    @property
    def spread(self) -> Tensor:
        """(3,), the standard deviation."""
        return (self.squares / self.count - self.mean.square()).clamp(min=0).sqrt()
