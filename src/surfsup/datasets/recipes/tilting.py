"""The recipe ``tilting``: a container of water is tilted, rocked or shaken.

The recipe is ours. The block is that of the recipe ``tanks``: it covers the whole floor, or a part of it like a dam.
The container turns by 8 to 30 degrees to one side, or to and fro, or is shifted to and fro by 5 to 12 cm. 300 frames.
"""

from __future__ import annotations

import math

import numpy as np

from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.tanks import GAP
from surfsup.datasets.recipes.water import block_at
from surfsup.scene import Container, Scene
from surfsup.scene.motion import Keyframe, Motion

FRAMES = 300
SIDE = (0.45, 0.8)  # meters of the container, along x and along y
HEIGHT = 1.2  # meters of the container
DEPTH = (0.15, 0.35)  # meters of the block
TILT = (8.0, 30.0)  # degrees
SHIFT = (0.05, 0.12)  # meters
SWING = (0.25, 0.45)  # seconds of a move from one side to the other
SWINGS = 4


def tilted(axis: tuple[float, float, float], random: Random) -> list[dict[str, object]]:
    """One tilt about a horizontal axis, which stays."""
    begin = random.uniform(0.1, 0.3)
    end = begin + random.uniform(0.3, 0.8)
    return [{"time": begin}, turned(end, axis, random.uniform(*TILT))]


def rocked(axis: tuple[float, float, float], random: Random) -> list[dict[str, object]]:
    """Tilts to one side and the other."""
    degrees, swing = random.uniform(*TILT) / 2, random.uniform(*SWING)
    keys = [turned((k + 1) * swing, axis, degrees * (-1) ** k) for k in range(SWINGS)]
    return [{"time": 0.0}, *keys, turned((SWINGS + 1) * swing, axis, 0.0)]


def shaken(axis: tuple[float, float, float], random: Random) -> list[dict[str, object]]:
    """Shifts along the axis to one side and the other."""
    shift, swing = random.uniform(*SHIFT), random.uniform(*SWING)
    places = [tuple(((-1) ** k * shift * np.array(axis)).tolist()) for k in range(SWINGS)]
    keys: list[dict[str, object]] = [{"time": (k + 1) * swing, "position": place} for k, place in enumerate(places)]
    return [{"time": 0.0}, *keys, {"time": (SWINGS + 1) * swing, "position": (0.0, 0.0, 0.0)}]


def turned(time: float, axis: tuple[float, float, float], degrees: float) -> dict[str, object]:
    """A keyframe with a turn about ``axis``."""
    return {"time": time, "rotation": {"axis": axis, "degrees": degrees}}


MOVES = (tilted, rocked, shaken)


class Tilting(Recipe):
    """One block of water on the floor of a container that moves."""

    name = "tilting"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: the three moves alternate, odd scenes have a dam, ``random`` determines the rest."""
        width, depth = random.uniform(*SIDE, size=2).tolist()
        direction = random.uniform(0.0, 2 * math.pi)
        axis = (math.cos(direction), math.sin(direction), 0.0)
        keys = [Keyframe.model_validate(key) for key in MOVES[index % len(MOVES)](axis, random)]
        container = Container(size=(width, depth, HEIGHT), motion=Motion(keyframes=keys))
        sides = np.array([width - 2 * GAP, depth - 2 * GAP, random.uniform(*DEPTH)])
        if index % 2:
            sides[0] *= random.uniform(0.4, 0.7)
        corner = np.add(container.lower, GAP)
        return Scene(container=container, fluid=[block_at(corner, sides)], frames=FRAMES)
