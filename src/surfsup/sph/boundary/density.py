"""What a solid adds to the density of a particle near it, as the solver weighs it.

The solver's solids are volume maps (Bender et al., "Volume Maps: An Implicit Boundary Representation for SPH", 2019):
the solid's share V of a particle's neighborhood, times the smoothing kernel at its nearest point. Of a flat solid both
follow from the distance alone. So at a bent one it is off by up to a tenth, at edges by a third and more.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from torch import Tensor

from surfsup.scene import PARTICLE_RADIUS
from surfsup.sph.kernels import KERNEL_SUPPORT, cubic_spline, cubic_spline_gradient

DEEPEST = -0.03  # meters: a particle deeper in the solid acts as if it were there
FARTHEST = 2 * KERNEL_SUPPORT  # meters from which on a solid has no share of the neighborhood
TABLE_STEP = 1e-4  # meters from one entry of the table to the next
SLICES = 1001  # of the ball that the volume is summed over

VOLUME_FACTOR = 0.8  # of the solver's volume maps
NEAREST = 2 * PARTICLE_RADIUS  # meters: no nearer does the solver take a solid to be
OFFSET = 0.5 * PARTICLE_RADIUS  # meters that it takes a solid to be farther off
STRENGTH = VOLUME_FACTOR * 32 / 3  # of a solid all around at no distance: the ball times the peak of the kernel


@cache
def table() -> np.ndarray:
    """The share (K,) that a flat solid has of a particle's neighborhood, ``DEEPEST`` to ``FARTHEST`` meters from it.

    Within the ball of the kernel's support around a particle, what is inside the solid counts whole, and outside as
    the kernel falls off with the distance to it.
    """
    distance = np.arange(round((FARTHEST - DEEPEST) / TABLE_STEP) + 1) * TABLE_STEP + DEEPEST
    up = np.linspace(-KERNEL_SUPPORT, KERNEL_SUPPORT, SLICES)
    areas = np.pi * (KERNEL_SUPPORT**2 - up**2)
    weight = cubic_spline((distance[:, None] + up).clip(min=0) / KERNEL_SUPPORT)
    shares = np.trapezoid(areas * weight, up, axis=1) / (4 / 3 * np.pi * KERNEL_SUPPORT**3)
    shares[-1] = 0.0
    return shares


@cache
def entries(dtype: torch.dtype, device: torch.device) -> Tensor:
    """The table (K,) as a tensor."""
    return torch.from_numpy(table()).to(device, dtype)


def flat_share(distance: Tensor) -> Tensor:
    """The share of its neighborhood (any shape) that a flat solid at a ``distance`` in meters has."""
    known = entries(distance.dtype, distance.device)
    place = ((distance - DEEPEST) / TABLE_STEP).clamp(0, len(known) - 1)
    low = place.detach().nan_to_num().long().clamp(max=len(known) - 2)
    part = place - low
    return known[low] * (1 - part) + known[low + 1] * part


def solid_density(distance: Tensor, share: Tensor) -> tuple[Tensor, Tensor]:
    """What a solid at a ``distance`` (any shape, meters) adds to density, and how fast that rises on the way to it.

    The rise is what the solver computes with: it takes the share to stay what it is.

    Args:
        distance: of the solid, meters.
        share: that it has of the neighborhood, of the same shape.

    Returns:
        The density in units of the lattice's, and its rise a support radius, of the same shape.
    """
    q = (distance + OFFSET).clamp(min=NEAREST, max=KERNEL_SUPPORT) / KERNEL_SUPPORT
    return STRENGTH * share * cubic_spline(q), -STRENGTH * share * cubic_spline_gradient(q)
