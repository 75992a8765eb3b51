"""Terrain: a grid of heights out of a file, as a closed solid."""

from __future__ import annotations

import warnings
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surfsup.errors import InputError
from surfsup.sdf.mesh.surface import MeshSurface

if TYPE_CHECKING:
    import trimesh

ENDINGS = (".png", ".tif", ".tiff", ".npz", ".npy")
GRAY_MODES = ("L", "F", "I")  # as Pillow calls gray of 8 bits, of floats and of 32 bits; those of 16 begin with I;
NODATA_TAG = 42113  # in which GDAL notes the value that stands for "not known"
MOST_IN_FILE = 50_000_000  # samples that are read at all
MOST_SAMPLES = 1_000_000  # that a surface is made of, two triangles each
ROUNDING = 1e-9


def load_heights(path: str | Path) -> np.ndarray:
    """The heights (rows, columns) float64 in a file, in the file's own unit; row 0 is north.

    A gray PNG of 8 or 16 bits, a GeoTIFF of one band, an NPY file, or an NPZ file with one two-dimensional array.
    Coordinates that the file may hold are not read.

    Raises:
        InputError: the file is missing, of another kind, damaged, in color, too small or too large, or has holes.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise InputError(f"{path}: is no terrain that can be read; give one that ends in {', '.join(ENDINGS)}")
    if not path.is_file():
        raise InputError(f"{path}: cannot be read; check the path")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's on large images: ours follows
            heights = read_array(path) if ending in (".npz", ".npy") else read_image(path)
    except InputError:
        raise
    except Exception as error:
        # Readers fail on damaged files in every way there is.
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(
            f"{path}: is damaged or is no {ending[1:].upper()} file ({reason}); export it again"
        ) from error
    if min(heights.shape) < 2:
        raise InputError(f"{path}: has {shape_text(heights)} samples; a terrain needs at least 2 along each side")
    holes = int((~np.isfinite(heights)).sum())
    if holes:
        raise InputError(
            f"{path}: has holes, {holes} of {heights.size} samples are not known; fill them first, "
            "for instance with gdal_fillnodata"
        )
    return heights


def read_image(path: Path) -> np.ndarray:
    """The samples of a gray image, float64; those that GDAL marked as not known are NaN.

    Raises:
        InputError: it is in color or too large.
    """
    from PIL import Image

    Image.init()
    with Image.open(path) as image:
        check_count(path, image.size)
        if image.mode not in GRAY_MODES and not image.mode.startswith("I;"):
            raise InputError(f"{path}: is no gray image (its mode is {image.mode}); give one whose gray is the height")
        nodata = getattr(image, "tag_v2", {}).get(NODATA_TAG)
        samples = np.asarray(image)
    heights = samples.astype(np.float64)
    if nodata is not None:
        # The mark is written in full, the samples may be rounded to single precision.
        mark = float(str(nodata).strip("\0 "))
        heights[heights == (np.float64(np.float32(mark)) if samples.dtype == np.float32 else mark)] = np.nan
    return heights


def read_array(path: Path) -> np.ndarray:
    """The samples of a NumPy file, float64; nothing in it is unpickled.

    Raises:
        InputError: it holds no array of numbers in two dimensions, several, or one that is too large.
    """
    if path.suffix.lower() == ".npy":
        arrays = {"": np.load(path, mmap_mode="r", allow_pickle=False)}
    else:
        with zipfile.ZipFile(path) as archive:
            check_count(path, (sum(entry.file_size for entry in archive.infolist()) // 8, 1))
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    grids = [array for array in arrays.values() if array.ndim == 2 and array.dtype.kind in "iuf"]
    if len(grids) != 1:
        raise InputError(f"{path}: holds {len(grids)} two-dimensional arrays of numbers, but must hold just one")
    check_count(path, grids[0].shape)
    return np.array(grids[0], dtype=np.float64)


def check_count(path: Path, shape: tuple[int, ...]) -> None:
    """Refuse more samples than fit into memory at ease.

    Raises:
        InputError: saying how many there are.
    """
    count = shape[0] * shape[1]
    if count > MOST_IN_FILE:
        raise InputError(f"{path}: has {count:,} samples, more than {MOST_IN_FILE:,}; cut out a part or reduce it")


class Heightfield(MeshSurface):
    """The solid between a terrain and z = 0, centered on x = y = 0: exact distance to its triangles.

    Every sample is a corner; column 0 lies in the west, at -x, and row 0 in the north, at +y. Only the side that a
    point is on is found otherwise than for other meshes: from the height below it, which takes a hundredth of the time.

    Args:
        heights: (rows, columns), any unit.
        size: extent in meters along x and y.
        height: meters from the lowest to the highest sample; where all are equal the terrain is a slab.
        base: meters of solid below the lowest sample.
        source: what to call the heights in a complaint.

    Raises:
        InputError: there are more samples than a surface can be made of.
    """

    def __init__(
        self, heights: np.ndarray, size: tuple[float, float], height: float, base: float, source: str = "heightfield"
    ) -> None:
        if heights.size > MOST_SAMPLES:
            raise InputError(
                f"{source}: has {shape_text(heights)} samples, more than a surface can be made of; "
                f"reduce it to {int(MOST_SAMPLES**0.5)} along each side"
            )
        span = float(np.ptp(heights))
        levels = base + height * ((heights - heights.min()) / span if span > 0 else np.zeros_like(heights))
        super().__init__(closed_mesh(levels, size), exact=True)
        self.levels, self.size = levels, np.array(size, dtype=np.float64)

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether each of ``points`` (N, 3) is below the terrain, above z = 0 and between the sides, (N,)."""
        return self.side(points)[0]

    def side(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same, and how many meters (N,) the surface can be from each: no more than it is straight up or down."""
        level, between = self.level_at(points)
        farthest = np.where(between, (1 + ROUNDING) * np.abs(points[:, 2] - level) + ROUNDING, np.inf)
        return between & (points[:, 2] > 0) & (points[:, 2] < level), farthest

    def level_at(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Height (N,) of the terrain above or below ``points`` (N, 3), and whether they are between its sides (N,)."""
        cells = np.array(self.levels.T.shape) - 1
        place = (points[:, :2] / self.size * [1.0, -1.0] + 0.5) * cells  # columns eastward, rows southward
        between = ((place >= 0) & (place <= cells)).all(axis=1)
        column, row = np.clip(place, 0, cells - 1).astype(np.int64).T
        east, south = (np.clip(place, 0, cells) - np.stack([column, row], axis=1)).T
        north_west, north_east = self.levels[row, column], self.levels[row, column + 1]
        south_west, south_east = self.levels[row + 1, column], self.levels[row + 1, column + 1]
        level = np.where(
            cut_falls(north_west, north_east, south_west, south_east),
            np.where(
                south > east,
                north_west + south * (south_west - north_west) + east * (south_east - south_west),
                north_west + east * (north_east - north_west) + south * (south_east - north_east),
            ),
            np.where(
                east + south < 1,
                north_west + east * (north_east - north_west) + south * (south_west - north_west),
                south_east + (1 - east) * (south_west - south_east) + (1 - south) * (north_east - south_east),
            ),
        )
        return level, between


def closed_mesh(levels: np.ndarray, size: tuple[float, float]) -> trimesh.Trimesh:
    """The triangles of terrain, sides and floor, from ``levels`` (rows, columns) and ``size`` along x and y, meters."""
    import trimesh

    rows, columns = levels.shape
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, columns) * size[0], np.linspace(0.5, -0.5, rows) * size[1])
    top = np.stack([x, y, levels], axis=-1).reshape(-1, 3)

    number = np.arange(rows * columns).reshape(rows, columns)
    north_west, north_east = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    south_west, south_east = number[1:, :-1].ravel(), number[1:, 1:].ravel()
    falls = cut_falls(*(top[corner, 2] for corner in (north_west, north_east, south_west, south_east)))
    first = np.stack([north_west, south_west, np.where(falls, south_east, north_east)], axis=1)
    second = np.stack([np.where(falls, north_west, south_west), south_east, north_east], axis=1)

    # Around the border from the north-west corner by the south, so counterclockwise as seen from above.
    border = np.concatenate([number[:-1, 0], number[-1, :-1], number[:0:-1, -1], number[0, :0:-1]])
    below = rows * columns + np.arange(len(border))
    middle = rows * columns + len(border)
    after, below_after = np.roll(border, -1), np.roll(below, -1)
    walls = [np.stack([border, below, below_after], axis=1), np.stack([border, below_after, after], axis=1)]
    floor = np.stack([below_after, below, np.full(len(border), middle)], axis=1)
    feet = top[border] * [1.0, 1.0, 0.0]
    return trimesh.Trimesh(
        np.concatenate([top, feet, np.zeros((1, 3))]), np.concatenate([first, second, *walls, floor]), process=False
    )


def cut_falls(
    north_west: np.ndarray, north_east: np.ndarray, south_west: np.ndarray, south_east: np.ndarray
) -> np.ndarray:
    """Whether a square of four samples is cut into triangles from north-west to south-east: the flatter way.

    So no ridge is notched.
    """
    return np.abs(north_west - south_east) <= np.abs(north_east - south_west)


def shape_text(heights: np.ndarray) -> str:
    """Rows and columns, for a message."""
    return f"{heights.shape[0]} x {heights.shape[1]}"
