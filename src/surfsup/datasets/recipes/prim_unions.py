"""The recipe ``prim-unions``: one primitive set on top of another (supplement, section 5.2).

That each of the ten pairs of different shapes is joined, the second on top of the base, is the supplement's, and so
are the shapes' own ranges. It leaves unsaid which is the base and how they stand; that is ours: the base stands
upright, and it is never the cone, on whose tip nothing would rest. The other is turned at random and stands on its
lowest point, sunk into the base so that the two are one solid. What is then higher than 1.3 m or wider than the
container is made smaller as a whole, so that there is room for the water.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from surfsup.datasets.recipes.extent import extent, lowest_point
from surfsup.datasets.recipes.prim_shapes import SHAPES, cone, room, turned
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import Random, block_above
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import Rotation

PAIRS = tuple(combinations(SHAPES, 2))
SINK = 0.08  # meters that the upper shape reaches into the base
HIGHEST = 1.3  # meters: under a ceiling of 2 m this leaves room for a block of 0.5 m and its fall


class PrimUnions(Recipe):
    """Two primitives, one on top of the other, under a block of water."""

    name = "prim-unions"

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``: the ten pairs take turns, all else is drawn from ``random``."""
        container = Container()
        first, second = PAIRS[index % len(PAIRS)]
        swap = random.random() < 0.5
        base_kind, upper_kind = (second, first) if first is cone or (swap and second is not cone) else (first, second)
        about_z = Rotation(axis=(0.0, 0.0, 1.0), degrees=random.uniform(0.0, 360.0))
        base = Shape(**base_kind(random), rotate=about_z)
        upper = turned(upper_kind(random), random)
        onto_seat = seat(base, random) - lowest_point(upper) - [0.0, 0.0, SINK]
        upper = upper.model_copy(update={"at": tuple(onto_seat.tolist())})

        corners = np.array([*extent(base), *extent(upper)])
        lowest, highest = corners.min(axis=0), corners.max(axis=0)
        scale = float(np.min([1.0, *([*container.size[:2], HIGHEST] / (highest - lowest))]))
        lowest, highest = scale * lowest, scale * highest
        place = [random.uniform(*room(lowest[axis], highest[axis], container.size[axis])) for axis in (0, 1)]
        solid = Shape(union=[base, upper], scale=scale, at=(*place, -float(lowest[2])))
        middle = place + (lowest + highest)[:2] / 2
        water = block_above(middle, float(highest[2] - lowest[2]), container, random)
        return Scene(container=container, surface=solid, fluid=water)


def seat(base: Shape, random: Random) -> np.ndarray:
    """A point (3,) of the highest part of an upright ``base``, where another shape can stand, meters.

    On a flat top it lies within half of the way to the rim, on a ring somewhere along the crest.
    """
    _, highest = extent(base)
    angle = random.uniform(0.0, 2 * np.pi)
    reach = {
        "sphere": lambda: 0.0,
        "box": lambda: random.uniform(0.0, min(base.box.size[:2]) / 4),
        "cylinder": lambda: random.uniform(0.0, base.cylinder.radius / 2),
        "torus": lambda: base.torus.major_radius,
    }[base.kind]()
    return np.array([reach * np.cos(angle), reach * np.sin(angle), highest[2]])
