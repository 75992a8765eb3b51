"""The fluid's number density relative to the lattice at rest."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from surfsup.scene import SPACING
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT, cubic_spline


def number_density(positions: np.ndarray) -> np.ndarray:
    """The number density (N,) at each particle: 1 inside the lattice, less at a free surface.

    It is the kernel sum over all neighbors and the particle itself, times the lattice's volume per particle. Solids and
    walls add nothing.

    Args:
        positions: (3, N), meters.
    """
    points = np.ascontiguousarray(positions.T)
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    first, second = tree.query_pairs(KERNEL_SUPPORT, output_type="ndarray").T
    displacement = points[first] - points[second]
    kernel = cubic_spline(np.sqrt(np.einsum("ij,ij->i", displacement, displacement)) / KERNEL_SUPPORT)
    count = len(points)
    total = 1 + np.bincount(first, kernel, count) + np.bincount(second, kernel, count)
    return total * KERNEL_PEAK * SPACING**3
