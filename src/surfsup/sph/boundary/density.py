"""Density of a solid near a particle, as the reference solver computes it.

The reference's solids are volume maps (Bender et al., "Volume Maps: An Implicit Boundary Representation for SPH",
2019): the solid's volume within the kernel support, times the kernel at its nearest point. For a plane solid both
follow from the distance alone. The plane is off by up to a tenth at a curved solid, and by a third or more at edges.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from torch import Tensor

from surfsup.scene import PARTICLE_RADIUS
from surfsup.sph.kernels import KERNEL_SUPPORT, cubic_spline, cubic_spline_gradient

MIN_DEPTH = -0.03  # meters, signed distance: particles deeper in the solid are treated as at this depth
FRACTION_REACH = 2 * KERNEL_SUPPORT  # meters: beyond it the volume fraction is zero
FRACTION_STEP = 1e-4  # meters between entries of the table of volume fractions
SLICES = 1001  # of the ball over which the volume is integrated

VOLUME_FACTOR = 0.8  # of the reference's volume maps
MIN_DISTANCE = 2 * PARTICLE_RADIUS  # meters: the reference treats closer solids as at this distance
DISTANCE_OFFSET = 0.5 * PARTICLE_RADIUS  # meters that the reference adds to the distance of a solid
# Density of a solid that fills the kernel support, at kernel value 1: volume of the ball times the kernel's peak.
STRENGTH = VOLUME_FACTOR * 32 / 3


@cache
def plane_fraction_table() -> np.ndarray:
    """Volume fraction (K,) of a plane solid at signed distances from ``MIN_DEPTH`` to ``FRACTION_REACH``.

    Within the ball of the kernel support, points inside the solid have weight one, and points outside the kernel at
    their distance from it.
    """
    distance = np.arange(round((FRACTION_REACH - MIN_DEPTH) / FRACTION_STEP) + 1) * FRACTION_STEP + MIN_DEPTH
    height = np.linspace(-KERNEL_SUPPORT, KERNEL_SUPPORT, SLICES)
    area = np.pi * (KERNEL_SUPPORT**2 - height**2)
    weight = cubic_spline((distance[:, None] + height).clip(min=0) / KERNEL_SUPPORT)
    fraction = np.trapezoid(area * weight, height, axis=1) / (4 / 3 * np.pi * KERNEL_SUPPORT**3)
    fraction[-1] = 0.0
    return fraction


@cache
def table_on(dtype: torch.dtype, device: torch.device) -> Tensor:
    """:func:`plane_fraction_table` as a tensor (K,)."""
    return torch.from_numpy(plane_fraction_table()).to(device, dtype)


def plane_fraction(distance: Tensor) -> Tensor:
    """Volume fraction of a plane solid at a signed ``distance`` in meters (any shape)."""
    table = table_on(distance.dtype, distance.device)
    place = ((distance - MIN_DEPTH) / FRACTION_STEP).clamp(0, len(table) - 1)
    low = place.detach().nan_to_num().long().clamp(max=len(table) - 2)
    part = place - low
    return table[low] * (1 - part) + table[low + 1] * part


def solid_density(distance: Tensor, fraction: Tensor) -> tuple[Tensor, Tensor]:
    """Density of a solid relative to the rest density, and its slope towards the solid per kernel support.

    As in the reference the slope holds the volume fraction constant.

    Args:
        distance: of the solid, meters (any shape).
        fraction: the solid's volume fraction in the kernel support, of the same shape.
    """
    q = (distance + DISTANCE_OFFSET).clamp(min=MIN_DISTANCE, max=KERNEL_SUPPORT) / KERNEL_SUPPORT
    return STRENGTH * fraction * cubic_spline(q), -STRENGTH * fraction * cubic_spline_gradient(q)
