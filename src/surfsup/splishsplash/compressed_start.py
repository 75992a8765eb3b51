"""Warns of fluid that starts so close to walls that the solver's first step throws it apart."""

from __future__ import annotations

import warnings

import numpy as np

from surfsup.scene import InitialParticles, Scene

# Meters, with particles of 15 mm, from a wall to the nearest particle's center. Closer lattices are denser than the
# solver allows: at one wall it ejects them at 4 m/s, in an edge or a corner, as in a pool, they gain 0.2 and 0.85 J/kg
# (all measured).
WALL_DISTANCE = 0.034
CORNER_DISTANCE = 0.049


class CompressedStartWarning(UserWarning):
    """The fluid starts so close to walls that the solver throws it apart; the message says where."""


def warn_compressed_start(scene: Scene, start: InitialParticles) -> None:
    """Warn if the particles of ``start`` are too close to the container's walls.

    Warns:
        CompressedStartWarning: they are.
    """
    positions, size = start.positions, scene.units.length
    if not len(positions):
        return
    gaps = np.concatenate(
        [positions.min(axis=0) - scene.container.lower, np.subtract(scene.container.upper, positions.max(axis=0))]
    )
    in_corner = (gaps < CORNER_DISTANCE * size).sum() > 1
    distance = (CORNER_DISTANCE if in_corner else WALL_DISTANCE) * size
    if gaps.min() < distance:
        warnings.warn(
            f"fluid: it begins {1000 * gaps.min():.3g} mm from {'several walls' if in_corner else 'a wall'}, where the "
            f"solver finds it too dense and throws it apart at once; leave {1000 * distance:.3g} mm to the first "
            "particle",
            CompressedStartWarning,
            stacklevel=2,
        )
