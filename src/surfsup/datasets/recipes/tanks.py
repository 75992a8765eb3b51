"""The recipe ``tanks``: nothing but water in a container, deep and shallow, resting, breaking and sloshing.

All of it is ours: the supplement's water is never deeper than some 0.2 m, and a model that has only seen that squeezes
what stands deeper. The block stands on the floor and covers it from wall to wall, or leaves some of it free, like a
dam; gravity is that of :mod:`assorted`. 400 frames.
"""

from __future__ import annotations

import numpy as np

from surfsup.datasets.recipes.assorted import gravity
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import Random
from surfsup.scene import SPACING, Block, Container, Fluid, Scene

FRAMES = 400
# Meters from walls and floor to the block. Where several walls meet it takes more than the gap to one:
# at 0.006 m the first step gains 0.85 J/kg, at 0.02 m nothing (measured, 0.4 m of water in a container of 0.4 m).
GAP = 0.02
SIDE = (0.35, 0.9)  # meters of the container, along x and along y
DEPTH = (0.15, 1.0)  # meters of the block
PARTICLES = (500, 6000)
COVERED = (0.3, 1.0)  # of a side, where the block does not reach from wall to wall


class Tanks(Recipe):
    """One block of water on the floor of an empty container."""

    name = "tanks"

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``: even ones cover the whole floor; all else is drawn from ``random``."""
        while True:
            container = Container(size=(*random.uniform(*SIDE, size=2).tolist(), 2.0))
            sides = np.array([*np.subtract(container.size[:2], 2 * GAP), random.uniform(*DEPTH)])
            if index % 2:
                sides[:2] *= random.uniform(*COVERED, size=2)
            if PARTICLES[0] < np.prod(sides) / SPACING**3 < PARTICLES[1]:
                break
        lower = np.add(container.lower, GAP)
        free = np.array([*np.subtract(container.size[:2], 2 * GAP), sides[2]]) - sides
        corner = lower + free * random.integers(2, size=3)  # in one of the corners
        block = Block(min=tuple(corner.tolist()), max=tuple((corner + sides).tolist()))
        return Scene(container=container, fluid=[Fluid(block=block)], gravity=gravity(random), frames=FRAMES)
