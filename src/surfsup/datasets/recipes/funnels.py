"""The recipe ``funnels``: water falls into a funnel and leaves it by the spout.

The shape is the one that the funnel task of section 7 of the supplement designs, and the ranges of its two radii hold
all of that task's designs: capture radius 0.10 to 0.221, filter radius 0.0714 to 0.09. The ranges are ours, as are the
lengths of cone and spout and where the funnel hangs: 0.15 to 0.5 m above the floor, upright.
"""

from __future__ import annotations

from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import Random, block_above
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import FunnelShape

CAPTURE_RADIUS = (0.1, 0.35)
FILTER_RADIUS = (0.065, 0.12)  # a narrower spout, two particles wide, clogs, and the solver lets the water burst
HEIGHT = (0.15, 0.35)  # meters of cone
SPOUT = (0.05, 0.15)
LIFT = (0.15, 0.5)  # meters from the floor to the spout


class Funnels(Recipe):
    """One funnel under a block of water."""

    name = "funnels"

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``; everything is drawn from ``random``."""
        container = Container()
        funnel = FunnelShape(
            capture_radius=random.uniform(*CAPTURE_RADIUS),
            filter_radius=random.uniform(*FILTER_RADIUS),
            height=random.uniform(*HEIGHT),
            spout=random.uniform(*SPOUT),
        )
        outer = funnel.capture_radius + funnel.wall
        place = random.uniform(-0.5 + outer, 0.5 - outer, size=2)
        mouth = random.uniform(*LIFT) + funnel.wall / 2 + funnel.spout + funnel.height
        return Scene(
            container=container,
            surface=Shape(funnel=funnel, at=(*place.tolist(), mouth)),
            fluid=block_above(place, mouth + funnel.wall / 2, container, random),
        )
