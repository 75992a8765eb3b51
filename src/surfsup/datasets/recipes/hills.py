"""The recipe ``hills``: water falls on terrains drawn at random, for training.

All of it is ours. A terrain from wall to wall, from smooth hills to rough ridges, of every third one the lowest part
level like a lake's bed; one or two blocks of water over its quarters. What the recipe ``mountain`` has is a terrain of
the real world, in one larger container: nothing of it is in here. 600 frames, for thin water takes long to come to
rest.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfsup.datasets.recipes.mesh_files import SURFACES
from surfsup.datasets.recipes.mountain import block_over, write_heights
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import Random
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import HeightfieldShape

FRAMES = 600
SIDE = (1.2, 2.0)  # meters of the container, along x and along y
HEIGHT = (0.15, 0.7)  # meters from the lowest to the highest place
BASE = 0.1  # meters below the lowest
CEILING = 2.0
BLOCKS = 2  # the most
SAMPLE = 0.02  # meters from one height to the next
ROUGHNESS = (1.9, 3.0)  # a wave's height falls with this power of its number
LEVEL = (0.1, 0.5)  # share of a terrain that is level, where some is
NUMBERS = 2**32  # of different terrains


class Hills(Recipe):
    """One or two blocks of water over a terrain drawn at random."""

    name = "hills"

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``; its terrain's file is written, named by the number that the terrain is made from."""
        number = int(random.integers(NUMBERS))
        x, y = random.uniform(*SIDE, size=2).tolist()
        heights = terrain((round(y / SAMPLE), round(x / SAMPLE)), np.random.default_rng(number))
        file = Path(SURFACES) / f"hills-{number:010d}.npy"
        if not (self.folder / file).exists():
            write_heights(self.folder / file, heights)
        solid = HeightfieldShape(file=file, size=(x, y), height=random.uniform(*HEIGHT), base=BASE)
        levels = BASE + solid.height * heights
        quarters = random.permutation(4)[: random.integers(1, BLOCKS + 1)]
        water = [block_over(levels, (x, y), (quarter % 2, quarter // 2), random) for quarter in quarters]
        scene = Scene(
            container=Container(size=(x, y, CEILING)), surface=Shape(heightfield=solid), fluid=water, frames=FRAMES
        )
        return scene.with_base_folder(self.folder)

    def set_aside(self, scene: Scene) -> None:
        """Take away the terrain of ``scene``, which no other has."""
        (self.folder / scene.surface.heightfield.file).unlink(missing_ok=True)


def terrain(shape: tuple[int, int], random: Random) -> np.ndarray:
    """Heights (rows, columns) from 0 to 1: waves of all lengths and random phases, the longer the higher.

    Every third terrain is level at its bottom.
    """
    rows, columns = (np.fft.fftfreq(2 * side) * 2 * side for side in shape)  # twice as wide: a wave does not come back
    number = np.hypot(rows[:, None], columns[None])
    height = np.where(number > 0, np.maximum(number, 1.0) ** -random.uniform(*ROUGHNESS), 0.0)
    waves = height * np.fft.fft2(random.normal(size=number.shape))
    heights = np.fft.ifft2(waves).real[: shape[0], : shape[1]]
    if random.integers(3) == 0:
        heights = np.maximum(heights, np.quantile(heights, random.uniform(*LEVEL)))
    return (heights - heights.min()) / np.ptp(heights)
