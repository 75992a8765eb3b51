"""Terrain files: a grid of heights as numbers."""

from __future__ import annotations

import math
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from surfsup.errors import InputError
from surfsup.sdf.mesh.readers.text import numbers

SUFFIXES = (".png", ".tif", ".tiff", ".asc", ".hgt", ".npz", ".npy")
GRAY_MODES = ("L", "F", "I")  # Pillow's modes for gray of 8 bits, floats and 32 bits; those of 16 bits start with I;
NODATA_TAG = 42113  # TIFF tag of GDAL for the value of unknown samples
MAX_FILE_SAMPLES = 50_000_000
VOIDS = (-9999.0, -32768.0, -32767.0)  # heights that stand for unknown ones by custom
GAP = 1000.0  # below the lowest other height, from which such a height is a void


def load_heights(path: str | Path) -> np.ndarray:
    """The heights (rows, columns) float64 in a file, in the units of the file; row 0 is north.

    The file is a gray PNG of 8 or 16 bits, a GeoTIFF of one band, an ESRI ASCII grid (ASC), a tile of SRTM (HGT), an
    NPY file, or an NPZ file with one two-dimensional array. Coordinates in the file are ignored.

    Raises:
        InputError: The file is missing, of another format, damaged, in color, too small or too large, or has holes.
            Heights that stand for unknown ones by custom (-9999, -32768, the least of the type) are holes, too.
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
            heights = READERS.get(suffix, read_image)(path)
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
    refuse_holes(path, heights)
    return heights


def refuse_holes(path: Path, heights: np.ndarray) -> None:
    """Refuse unknown samples, marked as such (NaN here) or by custom.

    Raises:
        InputError: There are some.
    """
    remedy = "fill them first, for instance with gdal_fillnodata"
    holes = int((~np.isfinite(heights)).sum())
    if holes:
        raise InputError(f"{path}: has holes: {holes} of {heights.size} samples are unknown; {remedy}")
    lowest = float(heights.min())
    others = heights[heights > lowest]
    by_custom = lowest in VOIDS or lowest <= np.iinfo(np.int32).min
    if by_custom and len(others) and others.min() - lowest > GAP:
        holes = heights.size - len(others)
        raise InputError(
            f"{path}: has holes: {holes} of {heights.size} samples are {lowest:.6g}, which stands for unknown heights "
            f"though the file does not say so; mark them by 'gdal_translate -a_nodata {lowest:.6g}' and {remedy}"
        )


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


def read_ascii_grid(path: Path) -> np.ndarray:
    """The samples of an ESRI ASCII grid, float64; those that its header declares as unknown are NaN.

    Raises:
        ValueError: The file is not such a grid.
    """
    words = path.read_text(encoding="utf-8-sig", errors="replace").split()
    header: dict[str, float] = {}
    at = 0
    while at + 1 < len(words) and words[at][0].isalpha():
        header[words[at].lower()] = float(words[at + 1].replace(",", "."))
        at += 2
    rows, columns = int(header["nrows"]), int(header["ncols"])
    check_count(path, (rows, columns))
    if rows < 1 or columns < 1 or rows * columns != len(words) - at:
        raise ValueError(f"its header announces {rows} x {columns} samples, and it has {len(words) - at}")
    heights = numbers(words[at:]).reshape(rows, columns)
    heights[heights == header.get("nodata_value", np.nan)] = np.nan
    return heights


def read_srtm_tile(path: Path) -> np.ndarray:
    """The samples of an HGT file, float64: a square of big-endian integers, where the least means unknown.

    Raises:
        ValueError: The file is no square.
    """
    count = path.stat().st_size // 2
    side = math.isqrt(count)
    check_count(path, (side, side))
    if side * side * 2 != path.stat().st_size or side < 2:
        raise ValueError("its size is not that of a square of 16-bit heights")
    heights = np.fromfile(path, ">i2").reshape(side, side).astype(np.float64)
    heights[heights == np.iinfo(np.int16).min] = np.nan
    return heights


READERS: dict[str, Callable[[Path], np.ndarray]] = {
    ".asc": read_ascii_grid,
    ".hgt": read_srtm_tile,
    ".npy": read_array,
    ".npz": read_array,
}


def shape_text(heights: np.ndarray) -> str:
    """Rows and columns, for messages."""
    return f"{heights.shape[0]} x {heights.shape[1]}"
