"""Terrain: a grid of heights from a file, as a closed solid."""

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

SUFFIXES = (".png", ".tif", ".tiff", ".npz", ".npy")
GRAY_MODES = ("L", "F", "I")  # Pillow's modes for gray of 8 bits, floats and 32 bits; those of 16 bits start with I;
NODATA_TAG = 42113  # TIFF tag of GDAL for the value of unknown samples
MAX_FILE_SAMPLES = 50_000_000
MAX_SAMPLES = 1_000_000  # of a surface, two triangles each
ROUNDING = 1e-9


def load_heights(path: str | Path) -> np.ndarray:
    """The heights (rows, columns) float64 in a file, in the units of the file; row 0 is north.

    The file is a gray PNG of 8 or 16 bits, a GeoTIFF of one band, an NPY file, or an NPZ file with one two-dimensional
    array. Coordinates in the file are ignored.

    Raises:
        InputError: The file is missing, of another format, damaged, in color, too small or too large, or has holes.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: is not a terrain that can be read; give one that ends in {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"{path}: cannot be read; check the path")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow warns of large images; check_count() raises an error
            heights = read_array(path) if suffix in (".npz", ".npy") else read_image(path)
    except InputError:
        raise
    except Exception as error:
        # Readers raise all kinds of exceptions on damaged files.
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(
            f"{path}: is damaged or not a {suffix[1:].upper()} file ({reason}); export it again"
        ) from error
    if min(heights.shape) < 2:
        raise InputError(f"{path}: has {shape_text(heights)} samples; a terrain needs at least 2 along each side")
    holes = int((~np.isfinite(heights)).sum())
    if holes:
        raise InputError(
            f"{path}: has holes: {holes} of {heights.size} samples are unknown; fill them first, "
            "for instance with gdal_fillnodata"
        )
    return heights


def read_image(path: Path) -> np.ndarray:
    """The samples of a gray image, float64; those that GDAL marks as unknown are NaN.

    Raises:
        InputError: The image is in color or too large.
    """
    from PIL import Image

    Image.init()
    with Image.open(path) as image:
        check_count(path, image.size)
        if image.mode not in GRAY_MODES and not image.mode.startswith("I;"):
            raise InputError(
                f"{path}: is not a gray image (its mode is {image.mode}); give one with heights as gray values"
            )
        nodata = getattr(image, "tag_v2", {}).get(NODATA_TAG)
        samples = np.asarray(image)
    heights = samples.astype(np.float64)
    if nodata is not None:
        # The tag has all digits of the value; the samples may be rounded to single precision.
        unknown = float(str(nodata).strip("\0 "))
        heights[heights == (np.float64(np.float32(unknown)) if samples.dtype == np.float32 else unknown)] = np.nan
    return heights


def read_array(path: Path) -> np.ndarray:
    """The samples of a NumPy file, float64; nothing is unpickled.

    Raises:
        InputError: The file contains no two-dimensional array of numbers, several, or one that is too large.
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
        raise InputError(f"{path}: contains {len(grids)} two-dimensional arrays of numbers, but must contain just one")
    check_count(path, grids[0].shape)
    return np.array(grids[0], dtype=np.float64)


def check_count(path: Path, shape: tuple[int, ...]) -> None:
    """Refuse files with too many samples.

    Raises:
        InputError: There are more than MAX_FILE_SAMPLES.
    """
    count = shape[0] * shape[1]
    if count > MAX_FILE_SAMPLES:
        raise InputError(f"{path}: has {count:,} samples, more than {MAX_FILE_SAMPLES:,}; cut out a part or reduce it")


class Heightfield(MeshSurface):
    """The solid between a terrain and z = 0, centered on x = y = 0, with the exact distance to its triangles.

    Every sample is a vertex. Column 0 is in the west, at -x, and row 0 in the north, at +y. Whether a point is inside
    follows from the height of the terrain at the point, which is a hundred times faster than winding numbers.

    Args:
        heights: (rows, columns), in any unit.
        size: Extent in meters along x and y.
        height: Meters from the lowest to the highest sample; if all are equal, the terrain is a slab.
        base: Meters of solid below the lowest sample.
        source: Name of the heights for error messages.

    Raises:
        InputError: There are too many samples.

    Examples:
        >>> import numpy as np, torch
        >>> hill = Heightfield(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0]]), size=(1, 1), height=0.25, base=0.25)
        >>> hill.bounds()[1].tolist()
        [0.5, 0.5, 0.5]
    """

    def __init__(
        self, heights: np.ndarray, size: tuple[float, float], height: float, base: float, source: str = "heightfield"
    ) -> None:
        if heights.size > MAX_SAMPLES:
            raise InputError(
                f"{source}: has {shape_text(heights)} samples, too many for a surface; "
                f"reduce it to {int(MAX_SAMPLES**0.5)} along each side"
            )
        span = float(np.ptp(heights))
        levels = base + height * ((heights - heights.min()) / span if span > 0 else np.zeros_like(heights))
        super().__init__(closed_mesh(levels, size), exact=True)
        self.levels, self.size = levels, np.array(size, dtype=np.float64)

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether each of ``points`` (N, 3) is below the terrain, above z = 0 and within its extent, (N,)."""
        return self.inside_and_max_distance(points)[0]

    def inside_and_max_distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same, and an upper bound (N,) of the distance in meters: the vertical distance to the terrain."""
        level, within = self.level_at(points)
        max_distance = np.where(within, (1 + ROUNDING) * np.abs(points[:, 2] - level) + ROUNDING, np.inf)
        return within & (points[:, 2] > 0) & (points[:, 2] < level), max_distance

    def level_at(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Height (N,) of the terrain above or below ``points`` (N, 3), and whether they are within its extent (N,)."""
        cells = np.array(self.levels.T.shape) - 1
        position = (points[:, :2] / self.size * [1.0, -1.0] + 0.5) * cells  # columns eastward, rows southward
        within = ((position >= 0) & (position <= cells)).all(axis=1)
        column, row = np.clip(position, 0, cells - 1).astype(np.int64).T
        east, south = (np.clip(position, 0, cells) - np.stack([column, row], axis=1)).T
        north_west, north_east = self.levels[row, column], self.levels[row, column + 1]
        south_west, south_east = self.levels[row + 1, column], self.levels[row + 1, column + 1]
        level = np.where(
            falling_diagonal(north_west, north_east, south_west, south_east),
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
        return level, within


def closed_mesh(levels: np.ndarray, size: tuple[float, float]) -> trimesh.Trimesh:
    """The triangles of terrain, sides and floor for ``levels`` (rows, columns) and ``size`` along x and y in meters."""
    import trimesh

    rows, columns = levels.shape
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, columns) * size[0], np.linspace(0.5, -0.5, rows) * size[1])
    top = np.stack([x, y, levels], axis=-1).reshape(-1, 3)

    number = np.arange(rows * columns).reshape(rows, columns)
    north_west, north_east = number[:-1, :-1].ravel(), number[:-1, 1:].ravel()
    south_west, south_east = number[1:, :-1].ravel(), number[1:, 1:].ravel()
    falls = falling_diagonal(*(top[corner, 2] for corner in (north_west, north_east, south_west, south_east)))
    first = np.stack([north_west, south_west, np.where(falls, south_east, north_east)], axis=1)
    second = np.stack([np.where(falls, north_west, south_west), south_east, north_east], axis=1)

    # The border from the north-west corner southward, which is counterclockwise as seen from above.
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


def falling_diagonal(
    north_west: np.ndarray, north_east: np.ndarray, south_west: np.ndarray, south_east: np.ndarray
) -> np.ndarray:
    """Whether the square of four samples is split from north-west to south-east: along the flatter diagonal.

    The flatter diagonal does not cut notches into ridges.
    """
    return np.abs(north_west - south_east) <= np.abs(north_east - south_west)


def shape_text(heights: np.ndarray) -> str:
    """Rows and columns, for messages."""
    return f"{heights.shape[0]} x {heights.shape[1]}"
