"""The recipe ``pouring``: a vessel of water is tilted over another one.

The recipe is ours. A round or a square cup turns about its middle by 95 to 125 degrees within 0.5 to 0.9 s, its lip
above a bowl or a square tray on the floor. 300 frames.
"""

from __future__ import annotations

import math

from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.scene import Block, Container, Scene, Shape
from surfsup.scene.motion import Keyframe, Motion
from surfsup.scene.shapes import BowlShape, BoxShape, CylinderShape
from surfsup.scene.solids import NamedShape

FRAMES = 300
CONTAINER = (1.8, 1.2, 1.8)  # meters
INSIDE = (0.2, 0.25)  # meters: half the width of the inside of a cup
WALL = 0.025  # meters, of cup and tray
HEIGHT = (0.36, 0.44)  # meters of a cup
GAP = 0.02  # meters between cup and water, as in the recipe tanks
TILT = (95.0, 125.0)  # degrees
FROM, LASTS = (0.05, 0.2), (0.5, 0.9)  # seconds
CATCHER = (0.34, 0.42)  # meters: half the width of what catches the water
CUT = 1.0  # meters that a hollow reaches beyond the mouth; the distance of a shorter cut would close the mouth


def round_cup(half: float, height: float) -> tuple[Shape, float]:
    """A cup about the middle of its height, and half the side of the block of water in it."""
    inside = Shape(cylinder=CylinderShape(radius=half, height=height + CUT), at=(0.0, 0.0, WALL + CUT / 2))
    outside = Shape(cylinder=CylinderShape(radius=half + WALL, height=height))
    return Shape(difference=[outside, inside]), half / math.sqrt(2)  # particles begin a spacing inside the block


def square_cup(half: float, height: float) -> tuple[Shape, float]:
    """The same with a square plan."""
    return Shape(difference=box_walls(half, height)), half - GAP


def box_walls(half: float, height: float) -> list[Shape]:
    """A box about the middle of its height, and what is cut from it."""
    inside = Shape(box=BoxShape(size=(2 * half, 2 * half, height + CUT)), at=(0.0, 0.0, WALL + CUT / 2))
    return [Shape(box=BoxShape(size=(2 * (half + WALL), 2 * (half + WALL), height))), inside]


CUPS = (round_cup, square_cup)


class Pouring(Recipe):
    """One cup that is tilted, full of water, and what catches the water."""

    name = "pouring"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: cups alternate, catchers every second scene; ``random`` determines the rest."""
        half, height = random.uniform(*INSIDE), random.uniform(*HEIGHT)
        cup, side = CUPS[index % 2](half, height)
        width = random.uniform(*CATCHER)
        if index % 4 < 2:
            catcher = NamedShape(bowl=BowlShape(capture_radius=width), at=(0.0, 0.0, width + 0.05))
            top = width + 0.05
        else:
            top = random.uniform(0.15, 0.25)
            catcher = NamedShape(difference=box_walls(width, top), at=(0.0, 0.0, top / 2 + 0.02))
        # The lip ends above the middle of the catcher; the cup turns clear of its rim.
        tilt = random.uniform(*TILT)
        lip = half * math.cos(math.radians(tilt)) + height / 2 * math.sin(math.radians(tilt))
        reach = math.hypot(half + WALL, height / 2)
        middle = (-lip + random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05), top + reach + 0.04)
        begin = random.uniform(*FROM)
        end = begin + random.uniform(*LASTS)
        motion = Motion(
            keyframes=[
                Keyframe(time=begin),
                Keyframe.model_validate({"time": end, "rotation": {"axis": (0.0, 1.0, 0.0), "degrees": tilt}}),
            ]
        )
        solid = NamedShape(union=[cup], at=middle, motion=motion)
        bottom = middle[2] - height / 2 + WALL + GAP
        water = random.uniform(0.65, 0.85) * (height - WALL - GAP)
        block = Block(
            (middle[0] - side, middle[1] - side, bottom), (middle[0] + side, middle[1] + side, bottom + water)
        )
        return Scene(
            container=Container(size=CONTAINER),
            surfaces={"catcher": catcher, "cup": solid},
            fluid=[block],
            frames=FRAMES,
        )
