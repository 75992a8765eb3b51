"""The recipe ``mountain``: water falls on the slopes of a terrain (supplement, section 5.5).

The terrain is that of ``--source FILE`` (a GeoTIFF, a gray PNG, NPZ or NPY) or, left out, the highest ridge in the
elevations around the Jacksboro fault that come with matplotlib. The supplement's is the Puncak Jaya range, scaled at
will. The sizes here are ours: 3 m along its longer side, filling the container from wall to wall, 0.7 m from the
lowest to the highest place, and three blocks of water over three of its four quarters. Finer detail than 160 samples
along the longer side is averaged away: that is 19 mm, which particles 30 mm apart cannot tell.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfsup.datasets.recipes.mesh_files import SURFACES
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import BLOCK_SIDE, Random, block
from surfsup.errors import InputError
from surfsup.scene import SPACING, Container, Fluid, Scene, Shape
from surfsup.scene.shapes import HeightfieldShape
from surfsup.sdf import load_heights

FILE = Path(SURFACES) / "mountain.npy"
SAMPLE = "jacksboro_fault_dem.npz"
RIDGE = (slice(190, 340), slice(125, 275))  # rows and columns of the sample
LONGER_SIDE = 3.0  # meters
HEIGHT = 0.7  # meters from the lowest to the highest place
BASE = 0.1  # meters below the lowest
CEILING = 2.0
MOST_SAMPLES = 160  # along the longer side
NARROWEST = 0.4  # of the longer side: a narrower strip has no room for the blocks
BLOCKS = 3
FALL_GAP = (0.05, 0.25)  # meters of air between the highest place under a block and the block


class Mountain(Recipe):
    """Blocks of water over a terrain."""

    name = "mountain"

    def prepare(self, source: Path | None, count: int) -> None:
        """Write the terrain's heights into the folder, unless they are there.

        Raises:
            InputError: the file is no terrain or too narrow; without one, matplotlib is not installed.
        """
        if (self.folder / FILE).exists():
            return
        heights = coarser(load_heights(sample_file())[RIDGE] if source is None else load_heights(source))
        rows, columns = heights.shape
        if min(rows, columns) < NARROWEST * max(rows, columns):
            raise InputError(f"{source}: is a strip of {rows} x {columns} samples; cut it to about a square")
        write_heights(self.folder / FILE, heights)

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``: where the blocks hang and how large they are is drawn from ``random``."""
        heights = load_heights(self.folder / FILE)
        rows, columns = heights.shape
        longer = max(rows, columns)
        size = (LONGER_SIDE * columns / longer, LONGER_SIDE * rows / longer)
        terrain = HeightfieldShape(file=FILE, size=size, height=HEIGHT, base=BASE)
        span = float(np.ptp(heights))
        levels = BASE + HEIGHT * (heights - heights.min()) / (span or 1.0)
        container = Container(size=(*size, CEILING))
        quarters = random.permutation(4)[:BLOCKS]
        water = [block_over(levels, size, (quarter % 2, quarter // 2), random) for quarter in quarters]
        return Scene(container=container, surface=Shape(heightfield=terrain), fluid=water).with_base_folder(self.folder)


def sample_file() -> Path:
    """Where matplotlib keeps its elevations.

    Raises:
        InputError: it is not installed.
    """
    try:
        from matplotlib import cbook
    except ImportError:
        raise InputError(
            "recipe 'mountain' takes its terrain from matplotlib, which is not installed; "
            "pip install 'surfsup[terrain]', or give a terrain of your own with --source"
        ) from None
    return Path(cbook.get_sample_data(SAMPLE, asfileobj=False))


def coarser(heights: np.ndarray) -> np.ndarray:
    """Means over squares of samples, as few as keep the longer side within MOST_SAMPLES; the rest is cut off."""
    step = -(-max(heights.shape) // MOST_SAMPLES)
    rows, columns = (max(1, side // step) for side in heights.shape)
    return heights[: rows * step, : columns * step].reshape(rows, step, columns, step).mean(axis=(1, 3))


def write_heights(file: Path, heights: np.ndarray) -> None:
    """Write heights (rows, columns) so that no reader ever sees half a file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f".{file.name}.partial")
    with partial.open("wb") as out:
        np.save(out, heights.astype(np.float32), allow_pickle=False)
    partial.replace(file)


def block_over(levels: np.ndarray, size: tuple[float, float], quarter: tuple[int, int], random: Random) -> Fluid:
    """A block of random sides at a random place in one quarter, above the highest place below it.

    Args:
        levels: (rows, columns) heights in meters, row 0 in the north.
        size: of the terrain along x and y, meters.
        quarter: 0 or 1 along x and along y.
        random: where all that is left open comes from.
    """
    sides = random.uniform(*BLOCK_SIDE, size=3)
    half = np.array(size) / 2
    low = np.where(quarter, 0.0, -half) + SPACING / 2  # so that blocks of two quarters do not touch
    corner = random.uniform(low, low + half - SPACING - sides[:2])

    rows, columns = levels.shape
    x, y = np.linspace(-half[0], half[0], columns), np.linspace(half[1], -half[1], rows)
    cell = max(x[1] - x[0], y[0] - y[1])
    under_x = (x > corner[0] - cell) & (x < corner[0] + sides[0] + cell)
    under_y = (y > corner[1] - cell) & (y < corner[1] + sides[1] + cell)
    top = float(levels[np.ix_(under_y, under_x)].max())
    bottom = min(top + random.uniform(*FALL_GAP), CEILING - SPACING - sides[2])
    return block(np.append(corner, bottom), sides)
