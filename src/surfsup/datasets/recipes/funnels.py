"""The recipe ``funnels``: water falls into a funnel and leaves it through the spout.

The shape is that of the funnel task in section 7 of the supplement. The ranges of its two radii are ours and contain
all designs of that task: capture radius 0.10 to 0.221, filter radius 0.0714 to 0.09. The lengths of cone and spout and
the place are ours too: 0.15 to 0.5 m above the floor, upright.
"""

from __future__ import annotations

from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import block_above
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import FunnelShape

CAPTURE_RADIUS = (0.1, 0.35)
FILTER_RADIUS = (0.065, 0.12)  # narrower spouts, two particles wide, clog, and the water bursts
HEIGHT = (0.15, 0.35)  # meters of cone
SPOUT = (0.05, 0.15)
LIFT = (0.15, 0.5)  # meters from the floor to the spout


class Funnels(Recipe):
    """One funnel under a block of water."""

    name = "funnels"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: ``random`` determines everything."""
        container = Container()
        funnel = FunnelShape(
            capture_radius=random.uniform(*CAPTURE_RADIUS),
            filter_radius=random.uniform(*FILTER_RADIUS),
            height=random.uniform(*HEIGHT),
            spout=random.uniform(*SPOUT),
        )
        outer = funnel.capture_radius + funnel.wall
        x, y = place = random.uniform(-0.5 + outer, 0.5 - outer, size=2).tolist()
        mouth = random.uniform(*LIFT) + funnel.wall / 2 + funnel.spout + funnel.height
        return Scene(
            container=container,
            surface=Shape(funnel=funnel, at=(x, y, mouth)),
            fluid=[block_above(place, mouth + funnel.wall / 2, container, random)],
        )
