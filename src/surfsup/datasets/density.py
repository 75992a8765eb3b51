"""How dense the fluid is, in units of the lattice that it starts on."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from surfsup.scene import SPACING
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT, cubic_spline


def number_density(positions: np.ndarray) -> np.ndarray:
    """The number density (N,) at each particle, 1 in the middle of the lattice; less at any surface.

    The sum of the cubic spline kernel over all neighbors (J. J. Monaghan, "Smoothed particle hydrodynamics",
    Annual Review of Astronomy and Astrophysics 30, 1992), times the lattice's volume a particle. Solids and walls
    add nothing.

    Args:
        positions: (3, N), meters.
    """
    points = np.ascontiguousarray(positions.T)
    first, second = (
        cKDTree(points, balanced_tree=False, compact_nodes=False).query_pairs(KERNEL_SUPPORT, output_type="ndarray").T
    )
    apart = points[first] - points[second]
    kernel = cubic_spline(np.sqrt(np.einsum("ij,ij->i", apart, apart)) / KERNEL_SUPPORT)
    count = len(points)
    total = 1 + np.bincount(first, kernel, count) + np.bincount(second, kernel, count)
    return total * KERNEL_PEAK * SPACING**3
