"""The recipe ``stirring``: water falls on a paddle that turns.

The recipe is ours. The paddle is a bar, a cross or a disc on edge, upright or tilted, near the floor of a container of
0.6 to 0.9 m. It turns about the vertical axis at 2 to 8 rad/s in either direction. 400 frames.
"""

from __future__ import annotations

from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import block_above
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.motion import Motion, Spin
from surfsup.scene.shapes import BoxShape, CylinderShape, Rotation
from surfsup.scene.solids import NamedShape

FRAMES = 400
SIDE = (0.6, 0.9)  # meters of the container
THICKNESS = (0.04, 0.08)  # meters of a blade
HEIGHT = (0.1, 0.25)  # meters of a blade
GAP = (0.04, 0.1)  # meters from the floor to the paddle
REACH = (0.55, 0.85)  # length of a blade, of the side of the container
RATE = (2.0, 8.0)  # rad/s
QUARTER = Rotation(axis=(0.0, 0.0, 1.0), degrees=90.0)


def bar(length: float, thickness: float, height: float) -> Shape:
    """One straight blade."""
    return Shape(box=BoxShape(size=(length, thickness, height)))


def cross(length: float, thickness: float, height: float) -> Shape:
    """Two blades at a right angle."""
    blade = BoxShape(size=(length, thickness, height))
    return Shape(union=[Shape(box=blade), Shape(box=blade, rotate=QUARTER)])


def disc(length: float, thickness: float, height: float) -> Shape:
    """A disc on edge, as wide as a blade is high."""
    flat = CylinderShape(radius=height, height=thickness)
    return Shape(cylinder=flat, rotate=Rotation(axis=(1.0, 0.0, 0.0), degrees=90.0))


PADDLES = (bar, cross, disc)


class Stirring(Recipe):
    """One paddle that turns, under a block of water."""

    name = "stirring"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: the three paddles alternate, ``random`` determines the rest."""
        side = random.uniform(*SIDE)
        container = Container(size=(side, side, 2.0))
        paddle = PADDLES[index % len(PADDLES)]
        height = random.uniform(*HEIGHT)
        shape = paddle(side * random.uniform(*REACH), random.uniform(*THICKNESS), height)
        half = height if paddle is disc else height / 2
        middle = random.uniform(*GAP) + half
        rate = random.uniform(*RATE) * (1 if random.random() < 0.5 else -1)
        phase = Rotation(axis=(0.0, 0.0, 1.0), degrees=random.uniform(0.0, 180.0))
        solid = NamedShape(
            union=[shape],
            rotate=phase,
            at=(0.0, 0.0, middle),
            motion=Motion(spin=Spin(axis=(0.0, 0.0, 1.0), rate=rate)),
        )
        place = (random.uniform(-0.1, 0.1) * side, random.uniform(-0.1, 0.1) * side)
        return Scene(
            container=container,
            surfaces={"paddle": solid},
            fluid=[block_above(place, middle + half, container, random)],
            frames=FRAMES,
        )
