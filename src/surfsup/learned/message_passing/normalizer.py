"""Normalization of vectors to zero mean and unit variance."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

MINIMUM_STD = 1e-9  # meters; a constant component is not divided by zero


class Normalizer(nn.Module):
    """Mean and standard deviation of a vector, by component. They are saved with the weights.

    Attributes:
        mean, std: (3,).
    """

    mean: Tensor
    std: Tensor

    def __init__(self, std: Sequence[float]) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(len(std)))
        self.register_buffer("std", torch.tensor(std))

    def normalize(self, values: Tensor) -> Tensor:
        """Values (..., 3) less the mean, in standard deviations."""
        return (values - self.mean) / self.std

    def denormalize(self, values: Tensor) -> Tensor:
        """The inverse of :meth:`normalize`."""
        return values * self.std + self.mean

    def set_statistics(self, statistics: RunningStatistics) -> None:
        """Replace mean and standard deviation by measured ones."""
        self.mean.copy_(statistics.mean)
        self.std.copy_(statistics.std.clamp(min=MINIMUM_STD))


class RunningStatistics:
    """Mean and standard deviation of vectors that arrive in batches."""

    def __init__(self) -> None:
        self.count = 0
        self.sum = torch.zeros(3, dtype=torch.float64)
        self.sum_of_squares = torch.zeros(3, dtype=torch.float64)

    def add(self, values: Tensor) -> None:
        """Add a batch (..., 3)."""
        values = values.detach().double().cpu().reshape(-1, 3)
        self.count += len(values)
        self.sum += values.sum(dim=0)
        self.sum_of_squares += values.square().sum(dim=0)

    @property
    def mean(self) -> Tensor:
        """The mean (3,)."""
        return self.sum / self.count

    @property
    def std(self) -> Tensor:
        """The standard deviation (3,)."""
        return (self.sum_of_squares / self.count - self.mean.square()).clamp(min=0).sqrt()
