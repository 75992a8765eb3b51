"""How far one frame of particles is from another, and what a frame is like by itself.

Formulas are those of the SURFSUP supplement, section 6.1. Its Chamfer distance is printed with squared
distances; the magnitudes that its tables report fit plain distances. Both are given, always.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from surfsup.scene import SPACING

SUPPORT = 2 * SPACING  # meters, the reach of the solver's smoothing kernel
MOST_NEIGHBOURS = 64  # about 33 fit into the kernel at rest


@dataclass(frozen=True)
class Nearest:
    """How far every particle is from the nearest one of the other set, meters.

    Attributes:
        there: (N,), from each predicted particle to the truth.
        back: (M,), from each true particle to the prediction.
    """

    there: np.ndarray
    back: np.ndarray


@dataclass(frozen=True)
class Chamfer:
    """Distance to the nearest particle of the other set, both ways added.

    Attributes:
        plain: of distances, meters.
        squared: of squared distances, square meters; the formula as printed.
    """

    plain: float
    squared: float


NO_CHAMFER = Chamfer(float("nan"), float("nan"))


def tree(positions: np.ndarray) -> cKDTree:
    """A search tree of ``positions`` (N, 3) that is quick to build."""
    return cKDTree(positions, balanced_tree=False)


def nearest(predicted: cKDTree, truth: cKDTree) -> Nearest:
    """Nearest neighbors both ways, by one query each way; they serve every Chamfer distance of the frame."""
    return Nearest(truth.query(predicted.data)[0], predicted.query(truth.data)[0])


def chamfer_of(apart: Nearest) -> Chamfer:
    """The Chamfer distance: the mean over one set plus the mean over the other."""
    there, back = apart.there, apart.back
    return Chamfer(float(there.mean() + back.mean()), float(np.square(there).mean() + np.square(back).mean()))


def chamfer(predicted: np.ndarray, truth: np.ndarray) -> Chamfer:
    """The Chamfer distance of ``predicted`` (N, 3) and ``truth`` (M, 3), meters."""
    return chamfer_of(nearest(tree(predicted), tree(truth)))


def chamfer_surface(apart: Nearest, near_there: np.ndarray, near_back: np.ndarray) -> Chamfer:
    """Chamfer Surface: the sum over the particles near the surface, each against ALL of the other set.

    Args:
        apart: nearest neighbors both ways.
        near_there: (N,) which predicted particles are near the surface.
        near_back: (M,) which true particles are.
    """
    there, back = apart.there[near_there], apart.back[near_back]
    return Chamfer(float(there.sum() + back.sum()), float(np.square(there).sum() + np.square(back).sum()))


def center_height(positions: np.ndarray) -> float:
    """Height of the center of mass of ``positions`` (N, 3), meters."""
    return float(positions[:, 2].mean(dtype=np.float64))


def kinetic_energy(velocities: np.ndarray) -> float:
    """Mean kinetic energy a unit of mass of ``velocities`` (N, 3), J/kg."""
    return float(0.5 * np.square(velocities, dtype=np.float64).sum(axis=-1).mean())


def highest_density(particles: cKDTree) -> float:
    """The largest density at a particle over that of the lattice at rest.

    The sum over neighbors of V·W(r), with V = (0.03 m)³ and the solver's cubic spline kernel W of support
    0.06 m; 1.00 on the lattice. Solids and walls are not counted, so beside them the density is too low,
    never too high. Only the 64 nearest neighbors count, about twice those at rest: a collapsed fluid reads
    as "very dense" without all its pairs having to fit into memory.
    """
    count = min(MOST_NEIGHBOURS, particles.n)
    apart = particles.query(particles.data, k=np.arange(1, count + 1), distance_upper_bound=SUPPORT)[0]
    return float((SPACING**3 * cubic_spline(apart)).sum(axis=1).max())


def cubic_spline(distance: np.ndarray) -> np.ndarray:
    """The kernel of the solver, 1/m³: a cubic spline of support SUPPORT that integrates to one (Monaghan 1992)."""
    q = np.minimum(distance / SUPPORT, 1.0)
    inner, outer = 6 * (q**3 - q**2) + 1, 2 * (1 - q) ** 3
    return 8 / (np.pi * SUPPORT**3) * np.where(q <= 0.5, inner, outer)


def inside_container(positions: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Which of ``positions`` (N, 3) are numbers and in the box from ``lower`` to ``upper`` (3,), meters: (N,)."""
    with np.errstate(invalid="ignore"):
        return ((positions >= lower) & (positions <= upper)).all(axis=-1)
