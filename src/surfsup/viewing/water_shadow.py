"""The soft shadow that water casts on solid and floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter

from surfsup.viewing import lighting
from surfsup.viewing.pixel_box import PixelBox
from surfsup.viewing.static_view import StaticView

_BLUR = 2.0  # particle radii
_STRENGTH = 0.4  # of the deepest shadow
_EXTINCTION = 14.0  # 1/m
_DISTANCE = 2.0  # container sides from the center: the reach of a low sun


class ShadowReceiver:
    """The pixels of a picture that water may shadow.

    Args:
        view: the picture without water.
        container_side: the longer horizontal side, meters.
    """

    def __init__(self, view: StaticView, container_side: float) -> None:
        finite = np.isfinite(view.depth)
        viewpoint = view.viewpoint
        eye = viewpoint.camera.eye.astype(np.float32)
        points = eye[:, None, None] + np.where(finite, view.depth, np.float32(0)) * viewpoint.rays
        self._receives = finite & (np.abs(points[:2]).max(0) < _DISTANCE * container_side)
        self._points = np.tensordot(light_space_axes(), points, 1)
        self._size = viewpoint.camera.size

    def shade(self, positions: np.ndarray, particle_radius: float) -> Shadow:
        """The shadow of particles at ``positions`` (N, 3)."""
        empty = PixelBox.around(np.empty((0, 2)), 0, self._size)
        if len(positions) == 0:
            return Shadow(empty, np.empty(0, int), np.empty(0, np.float32))
        grid = _LightGrid.of(positions, particle_radius)
        width = self._size[0]
        u, v = ((self._points[axis] - grid.low[axis]) / particle_radius for axis in (0, 1))
        rows, columns = grid.shape
        inside = self._receives & (u >= 0) & (u < rows - 1) & (v >= 0) & (v < columns - 1)
        pixels = np.flatnonzero(inside)
        if len(pixels) == 0:
            return Shadow(empty, pixels, np.empty(0, np.float32))
        light = grid.light(u[inside], v[inside], self._points[2][inside])
        ends = np.array([divmod(pixels[[0, -1]], width)[0], [0, 0]])
        occupied = np.flatnonzero(inside.any(0))
        ends[1] = occupied[[0, -1]]
        return Shadow(PixelBox.around(ends[::-1].T, 1, self._size), pixels, light)


@dataclass(frozen=True)
class Shadow:
    """A shadow on a picture.

    Attributes:
        box: around it.
        pixels: (M,) flat indices of pixels of the picture.
        light: (M,) the share of light that these receive, in (0.6, 1].
    """

    box: PixelBox
    pixels: np.ndarray
    light: np.ndarray

    def light_in(self, box: PixelBox, width: int) -> np.ndarray:
        """The share of light (h, w) in a box, which contains the shadow's, of a picture of that ``width``."""
        light = np.ones((box.bottom - box.top, box.right - box.left), np.float32)
        rows, columns = divmod(self.pixels, width)
        light[rows - box.top, columns - box.left] = self.light
        return light


@dataclass(frozen=True)
class _LightGrid:
    """Water as the sun sees it, in cells of a particle radius perpendicular to the sunbeams.

    Attributes:
        low: (2,) the center of the first cell, meters.
        thickness: (R, C) of the water along the beam, meters.
        height: (R, C), its mean height along the beam, meters.
    """

    low: np.ndarray
    thickness: np.ndarray
    height: np.ndarray
    radius: float

    @staticmethod
    def of(positions: np.ndarray, radius: float) -> _LightGrid:
        local = positions @ light_space_axes().T
        low = local[:, :2].min(0) - 6 * radius
        shape = tuple(np.ceil((local[:, :2].max(0) + 6 * radius - low) / radius).astype(int) + 1)
        cells = np.rint((local[:, :2] - low) / radius).astype(int)
        flat, volume = cells[:, 0] * shape[1] + cells[:, 1], (2 * radius) ** 3 / radius**2
        count, height_sum = (
            gaussian_filter(np.bincount(flat, weights, shape[0] * shape[1]).reshape(shape), _BLUR)
            for weights in (np.ones(len(local)), local[:, 2])
        )
        height = height_sum / np.maximum(count, 1e-9)
        return _LightGrid(low, np.float32(volume) * count.astype(np.float32), height.astype(np.float32), radius)

    @property
    def shape(self) -> tuple[int, int]:
        return self.thickness.shape[0], self.thickness.shape[1]

    def light(self, u: np.ndarray, v: np.ndarray, height: np.ndarray) -> np.ndarray:
        """The share of light at points (M,) with coordinates in cells, and a height along the beam in meters."""
        row, column = u.astype(np.int32), v.astype(np.int32)
        across, along = u - row, v - column
        corner = row * self.shape[1] + column
        # Between cells both are interpolated; the nearest cell's would show as a checkerboard.
        thickness, mean_height = (
            _between(values.ravel(), corner, self.shape[1], across, along) for values in (self.thickness, self.height)
        )
        above = np.clip((mean_height - height) / np.float32(3 * self.radius), 0.0, 1.0)  # 0 above the water
        return 1.0 - np.float32(_STRENGTH) * (1.0 - np.exp(np.float32(-_EXTINCTION) * thickness)) * above


def _between(values: np.ndarray, corner: np.ndarray, stride: int, across: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Bilinear interpolation in a flat grid, from its values at ``corner`` and the three cells behind it."""
    first = values[corner] + along * (values[corner + 1] - values[corner])
    corner = corner + stride
    second = values[corner] + along * (values[corner + 1] - values[corner])
    return first + across * (second - first)


def light_space_axes() -> np.ndarray:
    """Rows (3, 3): two directions perpendicular to the sunbeams, and the direction towards the sun."""
    right = np.cross(lighting.SUN_DIRECTION, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, lighting.SUN_DIRECTION), lighting.SUN_DIRECTION]).astype(np.float32)
