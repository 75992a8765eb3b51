"""The recipe ``prim-shapes``: water falls on one primitive (supplement, section 5.1).

The ranges of the shapes and of the block are the supplement's. It does not say where a shape stands or from what
height the water falls. Our choice: anywhere between the walls (in the middle if the shape is wider than the container),
and a gap of 0.05 to 0.65 m.
"""

from __future__ import annotations

from collections.abc import Callable

from surfsup.datasets.recipes.extent import extent
from surfsup.datasets.recipes.placement import random_place, random_rotation
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import block_above
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import BoxShape, ConeShape, CylinderShape, SphereShape, TorusShape


def sphere(random: Random) -> Shape:
    """Radius in [0.25, 0.5]."""
    return Shape(sphere=SphereShape(radius=random.uniform(0.25, 0.5)))


def box(random: Random) -> Shape:
    """Sides in [0.4, 0.7]."""
    x, y, z = random.uniform(0.4, 0.7, size=3).tolist()
    return Shape(box=BoxShape(size=(x, y, z)))


def cylinder(random: Random) -> Shape:
    """Radius in [0.15, 0.35], height in [0.4, 0.75]."""
    return Shape(cylinder=CylinderShape(radius=random.uniform(0.15, 0.35), height=random.uniform(0.4, 0.75)))


def cone(random: Random) -> Shape:
    """Height in [0.4, 0.7], bottom radius in [0.2, 0.4], top radius 0.01."""
    return Shape(cone=ConeShape(height=random.uniform(0.4, 0.7), bottom_radius=random.uniform(0.2, 0.4)))


def torus(random: Random) -> Shape:
    """Major radius in [0.2, 0.4], minor radius between a quarter and three quarters of it."""
    major = random.uniform(0.2, 0.4)
    return Shape(torus=TorusShape(major_radius=major, minor_radius=random.uniform(major / 4, 3 * major / 4)))


SHAPES: tuple[Callable[[Random], Shape], ...] = (sphere, box, cylinder, cone, torus)


class PrimShapes(Recipe):
    """One of the five primitives, rotated and placed at random, under a block of water."""

    name = "prim-shapes"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: the five shapes alternate, ``random`` determines the rest."""
        container = Container()
        shape = rotated(SHAPES[index % len(SHAPES)](random), random)
        lower, upper = extent(shape)
        x, y = random_place(lower, upper, container, random)
        shape = shape.model_copy(update={"at": (x, y, -float(lower[2]))})
        water = block_above((x, y), float(upper[2] - lower[2]), container, random)
        return Scene(container=container, surface=shape, fluid=[water])


def rotated(shape: Shape, random: Random) -> Shape:
    """The shape in a random orientation."""
    return shape.model_copy(update={"rotate": random_rotation(random)})
