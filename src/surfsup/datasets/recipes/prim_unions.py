"""The recipe ``prim-unions``: one primitive on top of another (supplement, section 5.2).

The ten pairs of different shapes, the second on top of the base, and the shapes' ranges are the supplement's. It does
not say which shape is the base and how the two stand. Our choice: the base stands upright, and is never the cone,
because nothing rests on its tip. The other has a random orientation and rests on its lowest point, sunk into the base
so that the two are one solid. A union higher than 1.3 m or wider than the container is scaled down, so that there is
room for the water.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from surfsup.datasets.recipes.extent import extent, lowest_point
from surfsup.datasets.recipes.placement import random_place, random_rotation_about_z
from surfsup.datasets.recipes.prim_shapes import SHAPES, cone, rotated
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import block_above
from surfsup.scene import Container, Scene, Shape

PAIRS = tuple(combinations(SHAPES, 2))
SINK = 0.08  # meters that the upper shape reaches into the base
MAX_HEIGHT = 1.3  # meters: under a ceiling of 2 m this leaves room for a block of 0.5 m and its fall


class PrimUnions(Recipe):
    """Two primitives, one on top of the other, under a block of water."""

    name = "prim-unions"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: the ten pairs alternate, ``random`` determines the rest."""
        container = Container()
        first, second = PAIRS[index % len(PAIRS)]
        swap = random.random() < 0.5
        draw_base, draw_upper = (second, first) if first is cone or (swap and second is not cone) else (first, second)
        rotation = random_rotation_about_z(random)
        base = draw_base(random).model_copy(update={"rotate": rotation})
        upper = rotated(draw_upper(random), random)
        offset = seat(base, random) - lowest_point(upper) - [0.0, 0.0, SINK]
        upper = upper.model_copy(update={"at": tuple(offset.tolist())})

        corners = np.array([*extent(base), *extent(upper)])
        lowest, highest = corners.min(axis=0), corners.max(axis=0)
        scale = float(np.min([1.0, *([*container.size[:2], MAX_HEIGHT] / (highest - lowest))]))
        lowest, highest = scale * lowest, scale * highest
        x, y = random_place(lowest, highest, container, random)
        solid = Shape(union=[base, upper], scale=scale, at=(x, y, -float(lowest[2])))
        middle = [x, y] + (lowest + highest)[:2] / 2
        water = block_above(middle, float(highest[2] - lowest[2]), container, random)
        return Scene(container=container, surface=solid, fluid=[water])


def seat(base: Shape, random: Random) -> np.ndarray:
    """A point (3,) on the highest part of an upright ``base`` where another shape can rest, meters.

    On a flat top it is at most halfway to the rim, on a torus anywhere along the crest.
    """
    _, highest = extent(base)
    angle = random.uniform(0.0, 2 * np.pi)
    radius = 0.0
    if base.box:
        radius = random.uniform(0.0, min(base.box.size[:2]) / 4)
    elif base.cylinder:
        radius = random.uniform(0.0, base.cylinder.radius / 2)
    elif base.torus:
        radius = base.torus.major_radius
    return np.array([radius * np.cos(angle), radius * np.sin(angle), highest[2]])
