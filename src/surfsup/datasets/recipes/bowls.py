"""The recipe ``bowls``: water falls into a bowl, with or without a hole.

The shape is that of the bowl task in section 7 of the supplement. The ranges of its two radii are ours and contain all
designs of that task: capture radius 0.07 to 0.232, filter radius 0 to 0.05. The place is ours too: up to 0.4 m above
the floor, upright. Every second bowl is closed.
"""

from __future__ import annotations

from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import block_above
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import BowlShape

CAPTURE_RADIUS = (0.07, 0.3)
FILTER_RADIUS = (0.03, 0.1)  # of bowls with a hole
MAX_FILTER_RATIO = 0.75  # filter radius over capture radius
LIFT = (0.0, 0.4)  # meters from the floor to the lowest point of a closed bowl


class Bowls(Recipe):
    """One bowl under a block of water."""

    name = "bowls"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: even ones are closed, odd ones have a hole, ``random`` determines the rest."""
        container = Container()
        capture = random.uniform(*CAPTURE_RADIUS)
        hole = min(random.uniform(*FILTER_RADIUS), MAX_FILTER_RATIO * capture) if index % 2 else 0.0
        bowl = BowlShape(capture_radius=capture, filter_radius=hole)
        outer = capture + bowl.wall
        x, y = place = random.uniform(-0.5 + outer, 0.5 - outer, size=2).tolist()
        mouth = outer + random.uniform(*LIFT)
        return Scene(
            container=container,
            surface=Shape(bowl=bowl, at=(x, y, mouth)),
            fluid=[block_above(place, mouth + bowl.wall / 2, container, random)],
        )
