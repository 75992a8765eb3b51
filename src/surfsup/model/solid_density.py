"""What a solid adds to the density of a particle near it, as the solver weighs it.

The solver's solids are volume maps (Bender et al., "Volume Maps: An Implicit Boundary Representation for SPH", 2019):
the solid's share V of a particle's neighbourhood, times the smoothing kernel at its nearest point. Of a flat solid both
follow from the distance alone. So at a bent one it is off by up to a tenth, at edges by a third and more.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from torch import Tensor

from surfsup.scene import PARTICLE_RADIUS, SPACING

SUPPORT = 2 * SPACING  # metres: how far the solver's kernel reaches
DEEPEST = -0.03  # metres: a particle deeper in the solid is felt as if it were there
TABLE_STEP = 1e-4  # metres from one entry of the table to the next
SLICES = 1001  # of the ball that the volume is summed over

VOLUME_FACTOR = 0.8  # of the solver's volume maps
NEAREST = 2 * PARTICLE_RADIUS  # metres: no nearer does the solver take a solid to be
OFFSET = 0.5 * PARTICLE_RADIUS  # metres that it takes a solid to be farther off


def smoothing(distance: np.ndarray) -> np.ndarray:
    """The cubic spline kernel at a ``distance`` in metres, as a share of its peak."""
    whole, inner = (np.clip(end - distance / SUPPORT, 0, None) for end in (1.0, 0.5))
    return 2 * whole**3 - 8 * inner**3


@cache
def table() -> np.ndarray:
    """Density (K,), in units of the lattice's, from ``DEEPEST`` to ``SUPPORT`` metres from a flat solid.

    Within the ball of the kernel's support around a particle, what is inside the solid counts whole, and outside as
    the kernel falls off with the distance to it.
    """
    distance = np.arange(round((SUPPORT - DEEPEST) / TABLE_STEP) + 1) * TABLE_STEP + DEEPEST
    up = np.linspace(-SUPPORT, SUPPORT, SLICES)
    areas = np.pi * (SUPPORT**2 - up**2)
    counts = smoothing(np.clip(distance[:, None] + up, 0, None))
    volumes = VOLUME_FACTOR * np.trapezoid(areas * counts, up, axis=1)
    peak = 8 / (np.pi * SUPPORT**3)
    density = volumes * peak * smoothing(np.maximum(distance + OFFSET, NEAREST))
    density[-1] = 0.0
    return density


@cache
def entries(dtype: torch.dtype, device: torch.device) -> Tensor:
    """Density and minus its slope a support radius (2, K), for interpolation."""
    density = table()
    return torch.from_numpy(np.stack([density, -SUPPORT * np.gradient(density, TABLE_STEP)])).to(device, dtype)


def solid_density(distance: Tensor) -> tuple[Tensor, Tensor]:
    """What a flat solid at a ``distance`` (any shape, metres) adds to density, and how fast that rises towards it.

    Returns:
        The density in units of the lattice's, and its slope towards the solid a support radius, of the same shape.
    """
    known = entries(distance.dtype, distance.device)
    place = ((distance - DEEPEST) / TABLE_STEP).clamp(0, known.shape[1] - 1)
    low = place.detach().nan_to_num().long().clamp(max=known.shape[1] - 2)
    part = place - low
    density, slope = known[:, low] * (1 - part) + known[:, low + 1] * part
    return density, slope
