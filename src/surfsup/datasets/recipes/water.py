"""The block of water of the recipes that drop one: its sides are the supplement's, the height of its fall is ours."""

from __future__ import annotations

import numpy as np

from surfsup.scene import SPACING, Block, Container, Fluid

BLOCK_SIDE = (0.4, 0.5)  # meters (supplement, section 5.1)
FALL_GAP = (0.05, 0.65)  # meters of air between the top of the solid and the block
# Meters between the block and a wall. The lattice begins one spacing inside the block; with its first row less than
# 0.034 m from a wall it is denser there than the solver allows, and the first step blows it away at 4 m/s (measured).
WALL_GAP = 0.006

Random = np.random.Generator


def block_above(place: np.ndarray, top: float, container: Container, random: Random) -> list[Fluid]:
    """One block of random sides above ``place`` (x, y), a random gap above ``top``, inside the container (meters)."""
    sides = random.uniform(*BLOCK_SIDE, size=3)
    bottom = min(top + random.uniform(*FALL_GAP), container.size[2] - SPACING - sides[2])
    lower, upper = np.add(container.lower[:2], WALL_GAP), np.subtract(container.upper[:2], WALL_GAP)
    corner = np.clip(place[:2] - sides[:2] / 2, lower, upper - sides[:2])
    return [block(np.append(corner, bottom), sides)]


def block(corner: np.ndarray, sides: np.ndarray) -> Fluid:
    """Water at rest from ``corner`` (3,) on, with ``sides`` (3,) in meters."""
    return Fluid(block=Block(min=tuple(corner.tolist()), max=tuple((corner + sides).tolist())))
