"""The block of water of the recipes that drop one: its sides are the supplement's, the height of its fall is ours."""

from __future__ import annotations

import numpy as np

from surfsup.scene import SPACING, Block, Container, Fluid

BLOCK_SIDE = (0.4, 0.5)  # metres (supplement, section 5.1)
FALL_GAP = (0.05, 0.65)  # metres of air between the top of the solid and the block

Random = np.random.Generator


def block_above(place: np.ndarray, top: float, container: Container, random: Random) -> list[Fluid]:
    """One block of random sides above ``place`` (x, y), a random gap above ``top``, inside the container (metres)."""
    sides = random.uniform(*BLOCK_SIDE, size=3)
    bottom = min(top + random.uniform(*FALL_GAP), container.size[2] - SPACING - sides[2])
    corner = np.clip(place[:2] - sides[:2] / 2, container.lower[:2], container.upper[:2] - sides[:2])
    return [block(np.append(corner, bottom), sides)]


def block(corner: np.ndarray, sides: np.ndarray) -> Fluid:
    """Water at rest from ``corner`` (3,) on, with ``sides`` (3,) in metres."""
    return Fluid(block=Block(min=tuple(corner.tolist()), max=tuple((corner + sides).tolist())))
