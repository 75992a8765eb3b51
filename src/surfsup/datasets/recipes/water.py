"""The block of water above a solid. Its size is the supplement's, the height of its fall is ours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from surfsup.datasets.recipes.recipe import Random
from surfsup.scene import SPACING, Block, Container

BLOCK_SIDE = (0.4, 0.5)  # meters (supplement, section 5.1)
FALL_GAP = (0.05, 0.65)  # meters between the top of the solid and the block
# Meters between the block and a wall. The lattice starts one spacing inside the block. If its first row is closer than
# 0.034 m to a wall, it is denser there than the solver allows, and the first step ejects it at 4 m/s (measured).
WALL_GAP = 0.006


def block_above(place: Sequence[float] | np.ndarray, top: float, container: Container, random: Random) -> Block:
    """A block of random size above ``place`` (x, y), a random gap above ``top``, inside the container (meters)."""
    sides = random.uniform(*BLOCK_SIDE, size=3)
    bottom = min(top + random.uniform(*FALL_GAP), container.size[2] - SPACING - sides[2])
    lower, upper = np.add(container.lower[:2], WALL_GAP), np.subtract(container.upper[:2], WALL_GAP)
    corner = np.clip(np.asarray(place) - sides[:2] / 2, lower, upper - sides[:2])
    return block_at(np.append(corner, bottom), sides)


def block_at(corner: np.ndarray, sides: np.ndarray) -> Block:
    """A block at rest with its lowest ``corner`` (3,) and its ``sides`` (3,) in meters."""
    (x, y, z), (upper_x, upper_y, upper_z) = corner.tolist(), (corner + sides).tolist()
    return Block((x, y, z), (upper_x, upper_y, upper_z))
