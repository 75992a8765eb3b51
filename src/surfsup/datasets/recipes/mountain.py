"""The recipe ``mountain``: water falls on the slopes of a terrain (supplement, section 5.5).

The terrain comes from ``--source FILE`` (a GeoTIFF, a gray PNG, NPZ or NPY). By default it is the highest ridge in the
elevations around the Jacksboro fault that matplotlib contains. The supplement's is the Puncak Jaya range at a scale of
its own. The sizes here are ours: 3 m along the longer side, from wall to wall of the container, 0.7 m from the lowest
to the highest sample, and three blocks of water above three of the four quarters. Detail finer than 160 samples along
the longer side is averaged: these are 19 mm apart, which particles 30 mm apart cannot resolve.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfsup.datasets.folder import SURFACES, atomic_write
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import BLOCK_SIDE, block_at
from surfsup.errors import InputError
from surfsup.scene import SPACING, Block, Container, Scene, Shape
from surfsup.scene.shapes import HeightfieldShape
from surfsup.sdf import load_heights

FILE = Path(SURFACES) / "mountain.npy"
SAMPLE_DATA = "jacksboro_fault_dem.npz"
RIDGE = (slice(190, 340), slice(125, 275))  # rows and columns of the sample data
LONGER_SIDE = 3.0  # meters
HEIGHT = 0.7  # meters from the lowest to the highest sample
BASE = 0.1  # meters below the lowest sample
CEILING = 2.0
MAX_SAMPLES = 160  # along the longer side
MIN_ASPECT = 0.4  # shorter over longer side: a narrower strip has no room for the blocks
BLOCKS = 3
FALL_GAP = (0.05, 0.25)  # meters between the highest point below a block and the block


class Mountain(Recipe):
    """Blocks of water above a terrain."""

    name = "mountain"

    def prepare(self, source: Path | None, count: int) -> None:
        """Write the terrain's heights into the folder, unless they are there.

        Raises:
            InputError: the file is not a terrain or too narrow; without one, matplotlib is not installed.
        """
        if (self.folder / FILE).exists():
            return
        heights = downsample(load_heights(sample_file())[RIDGE] if source is None else load_heights(source))
        rows, columns = heights.shape
        if min(rows, columns) < MIN_ASPECT * max(rows, columns):
            raise InputError(f"{source}: is a strip of {rows} x {columns} samples; cut it to about a square")
        write_heights(self.folder / FILE, heights)

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: ``random`` determines the places and sizes of the blocks."""
        heights = load_heights(self.folder / FILE)
        rows, columns = heights.shape
        longer = max(rows, columns)
        size = (LONGER_SIDE * columns / longer, LONGER_SIDE * rows / longer)
        terrain = HeightfieldShape(file=FILE, size=size, height=HEIGHT, base=BASE)
        span = float(np.ptp(heights))
        levels = BASE + HEIGHT * (heights - heights.min()) / (span or 1.0)
        container = Container(size=(*size, CEILING))
        quarters = random.permutation(4)[:BLOCKS]
        water = [block_over_quarter(levels, size, int(quarter), random) for quarter in quarters]
        return Scene(container=container, surface=Shape(heightfield=terrain), fluid=water).with_base_folder(self.folder)


def sample_file() -> Path:
    """The file of elevations in matplotlib.

    Raises:
        InputError: matplotlib is not installed.
    """
    try:
        from matplotlib import cbook
    except ImportError:
        raise InputError(
            "recipe 'mountain' takes its terrain from matplotlib, which is not installed; "
            "pip install 'surfsup[terrain]', or give a terrain of your own with --source"
        ) from None
    return Path(cbook.get_sample_data(SAMPLE_DATA, asfileobj=False))


def downsample(heights: np.ndarray) -> np.ndarray:
    """Means over squares of samples, with at most MAX_SAMPLES along the longer side; incomplete squares are cut off."""
    step = -(-max(heights.shape) // MAX_SAMPLES)
    rows, columns = (max(1, side // step) for side in heights.shape)
    return heights[: rows * step, : columns * step].reshape(rows, step, columns, step).mean(axis=(1, 3))


def write_heights(file: Path, heights: np.ndarray) -> None:
    """Write heights (rows, columns); the file appears only when it is complete."""
    with atomic_write(file) as partial, partial.open("wb") as out:
        np.save(out, heights.astype(np.float32), allow_pickle=False)


def block_over_quarter(levels: np.ndarray, size: tuple[float, float], quarter: int, random: Random) -> Block:
    """A block of random size at a random place in one quarter, above the highest point below it.

    Args:
        levels: (rows, columns) heights in meters, row 0 in the north.
        size: of the terrain along x and y, meters.
        quarter: 0 to 3; bit 0 chooses the half along x, bit 1 that along y.
        random: generator of the random numbers.
    """
    sides = random.uniform(*BLOCK_SIDE, size=3)
    half = np.array(size) / 2
    low = np.where((quarter % 2, quarter // 2), 0.0, -half) + SPACING / 2  # keeps blocks of two quarters apart
    corner = random.uniform(low, low + half - SPACING - sides[:2])

    rows, columns = levels.shape
    x, y = np.linspace(-half[0], half[0], columns), np.linspace(half[1], -half[1], rows)
    cell = max(x[1] - x[0], y[0] - y[1])
    under_x = (x > corner[0] - cell) & (x < corner[0] + sides[0] + cell)
    under_y = (y > corner[1] - cell) & (y < corner[1] + sides[1] + cell)
    top = float(levels[np.ix_(under_y, under_x)].max())
    bottom = min(top + random.uniform(*FALL_GAP), CEILING - SPACING - sides[2])
    return block_at(np.append(corner, bottom), sides)
