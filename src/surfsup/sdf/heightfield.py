"""Terrain as a closed solid."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from torch import Tensor

from surfsup.errors import InputError
from surfsup.sdf.mesh.surface import MeshSurface
from surfsup.sdf.terrain_file import shape_text

if TYPE_CHECKING:
    import trimesh

    from surfsup.sdf.mesh.device_query import DeviceQuery

MAX_SAMPLES = 1_500_000  # of a surface, two triangles each: a tile of 1201 x 1201 is one
ROUNDING = 1e-9


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

    @property
    def has_device_query(self) -> bool:
        """Warp queries terrain, too."""
        return True

    def on_device(self, like: Tensor) -> DeviceQuery:
        """The query for the device of a tensor."""
        from surfsup.sdf.mesh.device_query import TerrainOnDevice

        return TerrainOnDevice(self.query, self.levels, self.size, like)

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
