"""The recipe ``prim-shapes``: water falls on one primitive (supplement, section 5.1).

The ranges of the shapes and of the block are the supplement's. It leaves unsaid where on the floor a shape
may stand and from what height the water falls; those two are ours: anywhere that keeps the shape inside the
walls (in the middle when it is wider than they are), and a gap of 0.05 to 0.65 m.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation as ScipyRotation

from surfsup.datasets.recipes.extent import extent
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import Random, block_above
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import BoxShape, ConeShape, CylinderShape, Rotation, SphereShape, TorusShape


def sphere(random: Random) -> dict[str, object]:
    """Radius in [0.25, 0.5]."""
    return {"sphere": SphereShape(radius=random.uniform(0.25, 0.5))}


def box(random: Random) -> dict[str, object]:
    """Sides in [0.4, 0.7]."""
    return {"box": BoxShape(size=tuple(random.uniform(0.4, 0.7, size=3)))}


def cylinder(random: Random) -> dict[str, object]:
    """Radius in [0.15, 0.35], height in [0.4, 0.75]."""
    return {"cylinder": CylinderShape(radius=random.uniform(0.15, 0.35), height=random.uniform(0.4, 0.75))}


def cone(random: Random) -> dict[str, object]:
    """Height in [0.4, 0.7], bottom radius in [0.2, 0.4], top radius 0.01."""
    return {"cone": ConeShape(height=random.uniform(0.4, 0.7), bottom_radius=random.uniform(0.2, 0.4))}


def torus(random: Random) -> dict[str, object]:
    """Radius of the ring in [0.2, 0.4], of its tube between a quarter and three quarters of that."""
    major = random.uniform(0.2, 0.4)
    return {"torus": TorusShape(major_radius=major, minor_radius=random.uniform(major / 4, 3 * major / 4))}


SHAPES: tuple[Callable[[Random], dict[str, object]], ...] = (sphere, box, cylinder, cone, torus)


class PrimShapes(Recipe):
    """One of the five primitives, turned and placed at random, under a block of water."""

    name = "prim-shapes"

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``: the five shapes take turns, all else is drawn from ``random``."""
        container = Container()
        shape = turned(SHAPES[index % len(SHAPES)](random), random)
        lower, upper = extent(shape)
        place = [random.uniform(*room(lower[axis], upper[axis], container.size[axis])) for axis in (0, 1)]
        shape = shape.model_copy(update={"at": (*place, -float(lower[2]))})
        water = block_above(np.array(place), float(upper[2] - lower[2]), container, random)
        return Scene(container=container, surface=shape, fluid=water)


def turned(kind: dict[str, object], random: Random) -> Shape:
    """The primitive in a random orientation, all orientations being as likely."""
    turn = ScipyRotation.random(random_state=random).as_rotvec(degrees=True)
    degrees = float(np.linalg.norm(turn))
    return Shape(**kind, rotate=Rotation(axis=tuple((turn / degrees).tolist()), degrees=degrees))


def room(lower: float, upper: float, width: float) -> tuple[float, float]:
    """Where a shape that reaches from ``lower`` to ``upper`` may stand between walls ``width`` apart."""
    low, high = -width / 2 - lower, width / 2 - upper
    return (low, high) if low < high else ((low + high) / 2,) * 2
