"""How dense the fluid is, in units of the lattice that it starts on."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from surfsup.scene import SPACING

SUPPORT = 2 * SPACING  # meters: how far the solver's kernel reaches


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
        cKDTree(points, balanced_tree=False, compact_nodes=False).query_pairs(SUPPORT, output_type="ndarray").T
    )
    apart = points[first] - points[second]
    q = np.sqrt(np.einsum("ij,ij->i", apart, apart)) / SUPPORT
    kernel = np.where(q <= 0.5, 6 * (q**3 - q**2) + 1, 2 * (1 - q) ** 3)
    count = len(points)
    total = 1 + np.bincount(first, kernel, count) + np.bincount(second, kernel, count)
    return total * 8 / (np.pi * SUPPORT**3) * SPACING**3
