"""The cubic spline smoothing kernel W of SPH, with the support that the solver uses.

J. J. Monaghan, "Smoothed particle hydrodynamics", Annual Review of Astronomy and Astrophysics 30, 1992.
"""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from torch import Tensor

from surfsup.scene import SPACING

KERNEL_SUPPORT = 2 * SPACING  # meters, h; the kernel is zero beyond it
KERNEL_PEAK = 8 / (math.pi * KERNEL_SUPPORT**3)  # 1/m³, W(0); the integral of W over space is one

Array = TypeVar("Array", np.ndarray, Tensor)


def cubic_spline(q: Array) -> Array:
    """W(r) / W(0) at ``q`` = r / h (any shape, at least 0): 1 at 0, 1/4 at 1/2, 0 from 1 on."""
    outer, inner = (1 - q).clip(min=0), (0.5 - q).clip(min=0)
    return 2 * outer**3 - 8 * inner**3


def cubic_spline_gradient(q: Array) -> Array:
    """The derivative of :func:`cubic_spline` in ``q``; never positive."""
    outer, inner = (1 - q).clip(min=0), (0.5 - q).clip(min=0)
    return 24 * inner**2 - 6 * outer**2
