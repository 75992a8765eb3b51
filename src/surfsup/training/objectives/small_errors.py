"""The loss of small errors: the logarithm of the squared error."""

from __future__ import annotations

import torch
from torch import Tensor

SMALL_ERROR = 0.1  # in units of the normalized prediction; errors far below it count nothing


def small_error_loss(squared_error: Tensor) -> Tensor:
    """The loss (N,) of squared errors (N,), which rewards halving a small error as much as halving a large one.

    Compared with an impact, free fall and a pool at rest have no weight in a squared error. But they last: hundredths
    of a millimeter a frame in free fall add up to millimeters at the impact, which decide the splash.
    """
    return torch.log1p(squared_error / SMALL_ERROR**2)
