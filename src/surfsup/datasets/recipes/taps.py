"""The recipe ``taps``: water from a tap into a bowl, onto a solid, or up as a fountain.

The recipe is ours. Every second scene has a drain in a corner of the floor. A tap is 10 to 18 cm wide, gives 1.2 to 3
m/s and closes after 0.8 to 1.4 s. 400 frames; all scenes begin empty.
"""

from __future__ import annotations

from surfsup.datasets.recipes.extent import extent
from surfsup.datasets.recipes.prim_shapes import SHAPES, rotated
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.scene import Container, Drain, Scene, Shape, Tap
from surfsup.scene.shapes import BowlShape, BoxShape
from surfsup.scene.taps import DiscOpening

FRAMES = 400
SIDE = (0.8, 1.1)  # meters of the container
RADIUS = (0.05, 0.09)  # meters of the opening
SPEED = (1.2, 3.0)  # m/s
UNTIL = (0.8, 1.4)  # seconds
DRAIN = 0.1  # meters: height of a drain in the floor; centers of particles are at least 0.02 above it
SIZE = 0.5  # largest extent of a primitive, of the side of the container
POST = (0.15, 0.4)  # meters: height of the post of a fountain


def over_a_bowl(side: float, random: Random) -> dict[str, object]:
    """A tap above a bowl, off its axis."""
    bowl = BowlShape(capture_radius=random.uniform(0.15, 0.25))
    mouth = bowl.capture_radius + bowl.wall + random.uniform(0.0, 0.15)
    x, y = random.uniform(-0.3, 0.3, size=2) * bowl.capture_radius
    tap = tap_at((float(x), float(y), mouth + random.uniform(0.25, 0.5)), (0.0, 0.0, -1.0), random)
    return {"surface": Shape(bowl=bowl, at=(0.0, 0.0, mouth)), "taps": [tap]}


def onto_a_solid(side: float, random: Random) -> dict[str, object]:
    """A jet from near a wall onto a primitive."""
    shape = rotated(SHAPES[int(random.integers(len(SHAPES)))](random), random)
    lower, upper = extent(shape)
    scale = SIZE * side / float((upper - lower).max())
    height = scale * float(upper[2] - lower[2])
    shape = shape.model_copy(update={"scale": scale, "at": (0.0, 0.0, -scale * float(lower[2]))})
    place = (0.12 - side / 2, random.uniform(-0.1, 0.1), height + random.uniform(0.05, 0.3))
    target = (0.0, 0.0, 0.5 * height)
    direction = (target[0] - place[0], target[1] - place[1], target[2] - place[2])
    return {"surface": shape, "taps": [tap_at(place, direction, random)]}


def fountain(side: float, random: Random) -> dict[str, object]:
    """A tap on a post that points upward, a little aslant."""
    height = random.uniform(*POST)
    post = Shape(box=BoxShape(size=(0.1, 0.1, height)), at=(0.0, 0.0, height / 2))
    direction = (random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), 1.0)
    return {"surface": post, "taps": [tap_at((0.0, 0.0, height + 0.06), direction, random)]}


def tap_at(place: tuple[float, float, float], direction: tuple[float, float, float], random: Random) -> Tap:
    """A round tap of random width and speed."""
    return Tap(
        disc=DiscOpening(radius=random.uniform(*RADIUS)),
        at=place,
        direction=direction,
        speed=random.uniform(*SPEED),
        until=random.uniform(*UNTIL),
    )


KINDS = (over_a_bowl, onto_a_solid, fountain)


class Taps(Recipe):
    """Water that enters, and in every second scene leaves."""

    name = "taps"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: the three kinds alternate, odd scenes have a drain, ``random`` determines the rest."""
        side = random.uniform(*SIDE)
        content = KINDS[index % len(KINDS)](side, random)
        corner = Drain(box=BoxShape(size=(side / 3, side / 3, DRAIN)), at=(side / 3, side / 3, 0.0))
        return Scene(
            container=Container(size=(side, side, 2.0)),
            drains=[corner] if index % 2 else [],
            frames=FRAMES,
            **content,  # type: ignore[arg-type]
        )
