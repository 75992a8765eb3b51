"""The recipe ``tanks``: only water in a container, deep and shallow, at rest, breaking and sloshing.

The recipe is ours. The supplement's water is never deeper than about 0.2 m, and a model trained on it compresses deeper
water. The block stands on the floor and covers it from wall to wall, or leaves a part free like a dam. Gravity is that
of :mod:`assorted`. 400 frames.
"""

from __future__ import annotations

import numpy as np

from surfsup.datasets.recipes.assorted import random_gravity
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import block_at
from surfsup.scene import SPACING, Container, Scene

FRAMES = 400
# Meters from walls and floor to the block. Edges and corners need a wider gap than a single wall: at 0.006 m the first
# step gains 0.85 J/kg, at 0.02 m nothing (measured with 0.4 m of water in a container of 0.4 m).
GAP = 0.02
SIDE = (0.35, 0.9)  # meters of the container, along x and along y
DEPTH = (0.15, 1.0)  # meters of the block
PARTICLES = (500, 6000)
COVERED = (0.3, 1.0)  # fraction of a side of the container, for odd scenes


class Tanks(Recipe):
    """One block of water on the floor of an empty container."""

    name = "tanks"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: even ones cover the whole floor, ``random`` determines the rest."""
        while True:
            width, depth = random.uniform(*SIDE, size=2).tolist()
            container = Container(size=(width, depth, 2.0))
            sides = np.array([*np.subtract(container.size[:2], 2 * GAP), random.uniform(*DEPTH)])
            if index % 2:
                sides[:2] *= random.uniform(*COVERED, size=2)
            if PARTICLES[0] < np.prod(sides) / SPACING**3 < PARTICLES[1]:
                break
        lower = np.add(container.lower, GAP)
        free = np.array([*np.subtract(container.size[:2], 2 * GAP), sides[2]]) - sides
        corner = lower + free * random.integers(2, size=3)  # in one of the corners
        block = block_at(corner, sides)
        return Scene(container=container, fluid=[block], gravity=random_gravity(random), frames=FRAMES)
