"""How far one frame of particles is from another.

Formulas are those of the SURFSUP supplement, section 6.1. Its Chamfer distance is printed with squared
distances; the magnitudes that its tables report fit plain distances. Both are given, always.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree


@dataclass(frozen=True)
class Chamfer:
    """Mean distance to the nearest particle of the other set, both ways added.

    Attributes:
        plain: of distances, metres.
        squared: of squared distances, square metres; the formula as printed.
    """

    plain: float
    squared: float


def chamfer(predicted: np.ndarray, truth: np.ndarray) -> Chamfer:
    """The Chamfer distance of ``predicted`` (N, 3) and ``truth`` (M, 3), metres."""
    there = cKDTree(truth).query(predicted)[0]
    back = cKDTree(predicted).query(truth)[0]
    return Chamfer(float(there.mean() + back.mean()), float(np.square(there).mean() + np.square(back).mean()))


def centre_height(positions: np.ndarray) -> float:
    """Height of the centre of mass of ``positions`` (N, 3), metres."""
    return float(positions[:, 2].mean(dtype=np.float64))


def kinetic_energy(velocities: np.ndarray) -> float:
    """Mean kinetic energy a unit of mass of ``velocities`` (N, 3), J/kg."""
    return float(0.5 * np.square(velocities, dtype=np.float64).sum(axis=-1).mean())
