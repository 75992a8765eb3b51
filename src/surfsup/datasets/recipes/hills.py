"""The recipe ``hills``: water falls on random terrains, for training.

The recipe is ours. A terrain from wall to wall, from smooth hills to rough ridges, a third of them with a level bottom
like a lake's bed; one or two blocks of water above its quarters. It contains nothing of the recipe ``mountain``, which
is a terrain of the real world in one larger container. 600 frames, because thin water takes long to come to rest.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfsup.datasets.folder import SURFACES
from surfsup.datasets.recipes.mountain import block_over_quarter, write_heights
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import HeightfieldShape

FRAMES = 600
SIDE = (1.2, 2.0)  # meters of the container, along x and along y
HEIGHT = (0.15, 0.7)  # meters from the lowest to the highest sample
BASE = 0.1  # meters below the lowest sample
CEILING = 2.0
MAX_BLOCKS = 2
SAMPLE_SPACING = 0.02  # meters
SPECTRAL_EXPONENT = (1.9, 3.0)  # a wave's height falls with this power of its wave number
LEVEL_FRACTION = (0.1, 0.5)  # of the area of a terrain with a level bottom
SEEDS = 2**32  # number of different terrains


class Hills(Recipe):
    """One or two blocks of water above a random terrain."""

    name = "hills"

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index`` and write its terrain to a file with the terrain's seed in its name."""
        seed = int(random.integers(SEEDS))
        x, y = random.uniform(*SIDE, size=2).tolist()
        heights = terrain((round(y / SAMPLE_SPACING), round(x / SAMPLE_SPACING)), np.random.default_rng(seed))
        file = Path(SURFACES) / f"hills-{seed:010d}.npy"
        if not (self.folder / file).exists():
            write_heights(self.folder / file, heights)
        solid = HeightfieldShape(file=file, size=(x, y), height=random.uniform(*HEIGHT), base=BASE)
        levels = BASE + solid.height * heights
        quarters = random.permutation(4)[: random.integers(1, MAX_BLOCKS + 1)]
        water = [block_over_quarter(levels, (x, y), int(quarter), random) for quarter in quarters]
        scene = Scene(
            container=Container(size=(x, y, CEILING)), surface=Shape(heightfield=solid), fluid=water, frames=FRAMES
        )
        return scene.with_base_folder(self.folder)

    def discard(self, scene: Scene) -> None:
        """Remove the terrain of ``scene``, which no other scene has."""
        assert isinstance(scene.surface, Shape) and scene.surface.heightfield
        (self.folder / scene.surface.heightfield.file).unlink(missing_ok=True)


def terrain(shape: tuple[int, int], random: Random) -> np.ndarray:
    """Heights (rows, columns) from 0 to 1: waves of all lengths with random phases, longer ones higher.

    A third of the terrains have a level bottom.
    """
    # The grid is twice as wide as the terrain, so that no wave repeats within it.
    rows, columns = (np.fft.fftfreq(2 * side) * 2 * side for side in shape)
    wave_number = np.hypot(rows[:, None], columns[None])
    amplitude = np.where(wave_number > 0, np.maximum(wave_number, 1.0) ** -random.uniform(*SPECTRAL_EXPONENT), 0.0)
    waves = amplitude * np.fft.fft2(random.normal(size=wave_number.shape))
    heights = np.fft.ifft2(waves).real[: shape[0], : shape[1]]
    if random.integers(3) == 0:
        heights = np.maximum(heights, np.quantile(heights, random.uniform(*LEVEL_FRACTION)))
    return (heights - heights.min()) / np.ptp(heights)
