"""The recipe ``fine``: small things with fine particles.

The recipe is ours. A primitive or a bowl of some centimeters in a container of 0.2 to 0.3 m, and a block of water of 8
to 11 cm, with particles of radius 2.5 to 4 mm: 4,000 to 10,000. 300 frames, each as long as Froude similarity makes it.
"""

from __future__ import annotations

import numpy as np

from surfsup.datasets.recipes.extent import extent
from surfsup.datasets.recipes.prim_shapes import SHAPES, rotated
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import block_at
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import BowlShape

FRAMES = 300
RADIUS = 0.003  # meters, of a particle
SIDE = (0.2, 0.26)  # meters of the container
SIZE = (0.07, 0.12)  # largest extent of a primitive, meters
BLOCK_SIDE = (0.1, 0.13)  # meters
FALL = (0.02, 0.08)  # meters between solid and block


class Fine(Recipe):
    """A block of water on something small."""

    name = "fine"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: every third solid is a bowl, the others are primitives; ``random`` does the rest."""
        side = random.uniform(*SIDE)
        container = Container(size=(side, side, 0.5))
        size = random.uniform(*SIZE)
        if index % 3 == 2:
            top = size / 2 + random.uniform(0.02, 0.05)
            shape = Shape(bowl=BowlShape(capture_radius=size / 2, wall=0.01), at=(0.0, 0.0, top))
        else:
            shape = rotated(SHAPES[int(random.integers(len(SHAPES)))](random), random)
            lower, upper = extent(shape)
            scale = size / float((upper - lower).max())
            shape = shape.model_copy(update={"scale": scale, "at": (0.0, 0.0, -scale * float(lower[2]))})
            top = scale * float(upper[2] - lower[2])
        sides = random.uniform(*BLOCK_SIDE, size=3)
        middle = random.uniform(-0.02, 0.02, size=2)
        corner = np.append(middle - sides[:2] / 2, top + random.uniform(*FALL))
        return Scene(
            container=container,
            surface=shape,
            fluid=[block_at(corner, sides)],
            particle_radius=RADIUS,
            frames=FRAMES,
        )
