"""Water that the solver's first step throws apart, because it begins too near to walls."""

from __future__ import annotations

import warnings

import numpy as np

from surfsup.scene import Scene, Start

# Meters from a wall to the nearest particle's center, below which the solver finds the lattice denser than it allows:
# beside one wall (4 m/s at once), and in the edge or corner of several, as of a pool (0.2 and 0.85 J/kg); all measured.
BESIDE_A_WALL = 0.034
IN_A_CORNER = 0.049


class PressedWater(UserWarning):
    """The water begins so near to a wall that the solver throws it apart; the message says where."""


def warn_of_pressed_water(scene: Scene, start: Start) -> None:
    """Say where the water of ``start`` begins too near to the container's walls.

    Warns:
        PressedWater: it does.
    """
    positions = start.positions
    gaps = np.concatenate(
        [positions.min(axis=0) - scene.container.lower, np.subtract(scene.container.upper, positions.max(axis=0))]
    )
    in_corner = (gaps < IN_A_CORNER).sum() > 1
    room = IN_A_CORNER if in_corner else BESIDE_A_WALL
    if gaps.min() < room:
        warnings.warn(
            f"fluid: it begins {gaps.min():.3f} m from {'several walls' if in_corner else 'a wall'}, where the solver "
            f"finds it too dense and throws it apart at once; leave {room:.3f} m to the first particle",
            PressedWater,
            stacklevel=2,
        )
