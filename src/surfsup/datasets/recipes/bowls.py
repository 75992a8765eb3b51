"""The recipe ``bowls``: water falls into a bowl, with or without a hole.

The shape is the one that the bowl task of section 7 of the supplement designs, and the ranges of its two radii hold
all of that task's designs: capture radius 0.07 to 0.232, filter radius 0 to 0.05. The ranges are ours, as is where
the bowl hangs: up to 0.4 m above the floor, upright. Every second bowl is closed.
"""

from __future__ import annotations

from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import Random, block_above
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import BowlShape

CAPTURE_RADIUS = (0.07, 0.3)
FILTER_RADIUS = (0.03, 0.1)  # of those with a hole, at most as much of the capture radius as the next line says
WIDEST_HOLE = 0.75
LIFT = (0.0, 0.4)  # meters from the floor to the lowest point of a closed bowl


class Bowls(Recipe):
    """One bowl under a block of water."""

    name = "bowls"

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``: even ones are closed, odd ones have a hole; all else is drawn from ``random``."""
        container = Container()
        capture = random.uniform(*CAPTURE_RADIUS)
        hole = min(random.uniform(*FILTER_RADIUS), WIDEST_HOLE * capture) if index % 2 else 0.0
        bowl = BowlShape(capture_radius=capture, filter_radius=hole)
        outer = capture + bowl.wall
        place = random.uniform(-0.5 + outer, 0.5 - outer, size=2)
        mouth = outer + random.uniform(*LIFT)
        return Scene(
            container=container,
            surface=Shape(bowl=bowl, at=(*place.tolist(), mouth)),
            fluid=block_above(place, mouth + bowl.wall / 2, container, random),
        )
