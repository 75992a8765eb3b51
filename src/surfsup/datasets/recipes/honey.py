"""The recipe ``honey``: a viscous liquid falls on one primitive.

The recipe is ours. Solid and block are those of ``prim-shapes``; the kinematic viscosity is 0.03 to 1 m²/s, uniform in
its logarithm: with particles of 1 mm that is 0.5 to 17 times that of honey. Every second liquid slips on solids. 300
frames.
"""

from __future__ import annotations

import math

from surfsup.datasets.recipes.prim_shapes import PrimShapes
from surfsup.datasets.recipes.recipe import Random
from surfsup.scene import Liquid, Scene

FRAMES = 300
VISCOSITY = (0.03, 1.0)  # m²/s


class Honey(PrimShapes):
    """One of the five primitives, rotated and placed at random, under a block of a viscous liquid."""

    name = "honey"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: the five shapes alternate, and with and without friction."""
        drawn = super().scene(index, random)
        least, most = map(math.log, VISCOSITY)
        viscosity = math.exp(random.uniform(least, most))
        liquid = Liquid(viscosity=viscosity, friction=1.0 - index % 2)
        return Scene(container=drawn.container, surface=drawn.surface, fluid=drawn.fluid, liquid=liquid, frames=FRAMES)
