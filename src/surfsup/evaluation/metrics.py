"""Distances between two frames of particles, and quantities of one frame.

The formulas are those of the SURFSUP supplement, section 6.1. The supplement prints its Chamfer distance with squared
distances, but the magnitudes in its tables fit plain distances; both are computed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from surfsup.scene import SPACING
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT, cubic_spline

MAX_NEIGHBORS = 64  # about 33 are within the kernel support at rest


@dataclass(frozen=True)
class NearestDistances:
    """Distance from each particle to the nearest particle of the other set, meters.

    Attributes:
        to_reference: (N,), from each predicted particle.
        to_prediction: (M,), from each reference particle.
    """

    to_reference: np.ndarray
    to_prediction: np.ndarray


@dataclass(frozen=True)
class Chamfer:
    """Distance to the nearest particle of the other set, both directions added.

    Attributes:
        plain: of distances, meters.
        squared: of squared distances, square meters; the formula as printed.
    """

    plain: float
    squared: float


UNDEFINED_CHAMFER = Chamfer(float("nan"), float("nan"))


def kd_tree(positions: np.ndarray) -> cKDTree:
    """A search tree of ``positions`` (N, 3) that is fast to build."""
    return cKDTree(positions, balanced_tree=False)


def nearest_distances(prediction: cKDTree, reference: cKDTree) -> NearestDistances:
    """Nearest-neighbor distances in both directions; every Chamfer distance of a frame needs only these."""
    return NearestDistances(
        np.asarray(reference.query(prediction.data)[0]), np.asarray(prediction.query(reference.data)[0])
    )


def mean_chamfer(distances: NearestDistances) -> Chamfer:
    """The Chamfer distance: the mean over one set plus the mean over the other."""
    there, back = distances.to_reference, distances.to_prediction
    return Chamfer(float(there.mean() + back.mean()), float(np.square(there).mean() + np.square(back).mean()))


def chamfer(prediction: np.ndarray, reference: np.ndarray) -> Chamfer:
    """The Chamfer distance of ``prediction`` (N, 3) and ``reference`` (M, 3), meters."""
    return mean_chamfer(nearest_distances(kd_tree(prediction), kd_tree(reference)))


def chamfer_surface(distances: NearestDistances, prediction_near: np.ndarray, reference_near: np.ndarray) -> Chamfer:
    """Chamfer Surface: the sum over the particles near the surface, each against ALL particles of the other set.

    Args:
        distances: nearest-neighbor distances in both directions.
        prediction_near: (N,) whether a predicted particle is near the surface.
        reference_near: (M,) whether a reference particle is near the surface.
    """
    there, back = distances.to_reference[prediction_near], distances.to_prediction[reference_near]
    return Chamfer(float(there.sum() + back.sum()), float(np.square(there).sum() + np.square(back).sum()))


def center_height(positions: np.ndarray) -> float:
    """Height of the center of mass of ``positions`` (N, 3), meters."""
    return float(positions[:, 2].mean(dtype=np.float64))


def kinetic_energy(velocities: np.ndarray) -> float:
    """Mean kinetic energy per unit mass of ``velocities`` (N, 3), J/kg."""
    return float(0.5 * np.square(velocities, dtype=np.float64).sum(axis=-1).mean())


def max_density(particles: cKDTree, scale: float = 1.0) -> float:
    """The largest density at a particle, relative to that of the lattice at rest.

    The density is the sum over neighbors of V·W(r), with V = (0.03 m)³ and the cubic spline kernel W of support 0.06 m;
    it is 1.00 on the lattice. Solids and walls are not counted, so the density beside them is too low, never too high.
    Only the 64 nearest neighbors count, about twice as many as at rest. This bounds the memory for a collapsed fluid
    and still reports it as very dense.

    Args:
        particles: the search tree of the positions.
        scale: particle radius over 15 mm, the factor of both lengths.
    """
    count = min(MAX_NEIGHBORS, particles.n)
    distances = particles.query(particles.data, k=np.arange(1, count + 1), distance_upper_bound=scale * KERNEL_SUPPORT)[
        0
    ]
    q = np.asarray(distances) / (scale * KERNEL_SUPPORT)
    return float(SPACING**3 * KERNEL_PEAK * cubic_spline(q).sum(axis=1).max())


def inside_container(positions: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Which of ``positions`` (N, 3) are finite and in the box from ``lower`` to ``upper`` (3,), meters; (N,) bool."""
    with np.errstate(invalid="ignore"):
        return np.all((positions >= lower) & (positions <= upper), axis=-1)
