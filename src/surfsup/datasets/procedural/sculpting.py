"""Sculpting: a signed distance field on a grid, built up part by part and meshed by marching cubes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import label

if TYPE_CHECKING:
    import trimesh

FAR = 1.0  # meters: the value of the empty grid
MARGIN = 3  # cells around a part that it changes

DistanceField = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
Point = tuple[float, float, float]


class SculptureGrid:
    """A signed distance field on a grid from ``lower`` to ``upper`` in cells of size ``cell`` (meters), empty at first.

    Each part changes only the cells near it, so that thousands of parts are cheap. A distance field takes x, y and z,
    which broadcast against each other. Its value must be a distance near the part's surface only.
    """

    def __init__(self, lower: Point, upper: Point, cell: float) -> None:
        self.cell = cell
        # The shift by a fraction of a cell keeps flat faces off the grid points, where marching cubes splits vertices.
        start = np.array(lower) - (MARGIN + 0.618) * cell
        counts = np.ceil((np.array(upper) + (MARGIN + 0.618) * cell - start) / cell).astype(int)
        self.axes = [start[axis] + cell * np.arange(counts[axis]) for axis in range(3)]
        self.values = np.full(counts, FAR, dtype=np.float32)

    def add(self, field: DistanceField, lower: np.ndarray, upper: np.ndarray, blend: float = 0.0) -> None:
        """Add a part between two corners, with a fillet of up to ``blend`` meters to the other parts."""
        window, where = self._window(lower, upper, blend)
        self.values[window] = smooth_minimum(self.values[window], field(*where), blend)

    def subtract(self, field: DistanceField, lower: np.ndarray, upper: np.ndarray, blend: float = 0.0) -> None:
        """Subtract a part between two corners."""
        window, where = self._window(lower, upper, blend)
        self.values[window] = -smooth_minimum(-self.values[window], field(*where), blend)

    def displace(self, depth: DistanceField, lower: np.ndarray, upper: np.ndarray) -> None:
        """Displace the surface between two corners inward by ``depth`` meters."""
        window, where = self._window(lower, upper, 0.0)
        self.values[window] += np.asarray(depth(*where), dtype=np.float32)

    def add_tube(self, points: list[Point], radii: list[float], blend: float = 0.0) -> None:
        """Add a tube through ``points`` with the ``radii`` (meters) at each of them."""
        places = np.array(points, dtype=float)
        for start, end, first, second in zip(places[:-1], places[1:], radii[:-1], radii[1:], strict=True):
            radius = max(first, second)
            corners = np.minimum(start, end) - radius, np.maximum(start, end) + radius
            self.add(tapered_capsule(start, end, first, second), *corners, blend)

    def add_ellipsoid(self, center: Point, radii: Point, blend: float = 0.0) -> None:
        """Add an ellipsoid."""
        middle, half = np.array(center), np.array(radii)
        self.add(ellipsoid(middle, half), middle - half, middle + half, blend)

    def add_box(self, lower: Point, upper: Point, rounding: float = 0.0, blend: float = 0.0) -> None:
        """Add a box with rounded edges."""
        low, high = np.array(lower), np.array(upper)
        self.add(rounded_box(low, high, rounding), low, high, blend)

    def to_mesh(self) -> trimesh.Trimesh:
        """The largest connected solid without its cavities as closed triangles in meters, by marching cubes."""
        import igl
        import trimesh

        counts = self.values.shape
        solid = self._largest_solid()
        z, y, x = np.meshgrid(self.axes[2], self.axes[1], self.axes[0], indexing="ij")  # libigl wants x fastest
        grid = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
        values = np.ascontiguousarray(solid.T, dtype=np.float64).ravel()
        vertices, faces, *_ = igl.marching_cubes(values, grid, *counts, 0.0)
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        if mesh.volume < 0:
            mesh.invert()
        return mesh

    def _largest_solid(self) -> np.ndarray:
        """The values without separate pieces and without cavities, which no water can reach."""
        pieces, _ = label(self.values < 0)
        largest = np.bincount(pieces[pieces > 0]).argmax()
        values = np.where((pieces > 0) & (pieces != largest), self.cell, self.values)
        cavities, _ = label(values >= 0)
        return np.where((cavities > 0) & (cavities != cavities[0, 0, 0]), -self.cell, values)

    def _window(self, lower: np.ndarray, upper: np.ndarray, blend: float) -> tuple[tuple[slice, ...], list[np.ndarray]]:
        """The part of the grid around two corners, and its x, y and z, which broadcast to its shape."""
        margin = blend + MARGIN * self.cell
        window = tuple(
            slice(*np.searchsorted(axis, (low - margin, high + margin)))
            for axis, low, high in zip(self.axes, lower, upper, strict=True)
        )
        return window, list(
            np.ix_(*(axis[part].astype(np.float32) for axis, part in zip(self.axes, window, strict=True)))
        )


def tapered_capsule(start: np.ndarray, end: np.ndarray, first: float, second: float) -> DistanceField:
    """A capsule from ``start`` to ``end`` whose radius changes linearly from ``first`` to ``second``."""
    along = end - start
    squared = max(float(along @ along), 1e-12)

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        fraction = np.clip(
            ((x - start[0]) * along[0] + (y - start[1]) * along[1] + (z - start[2]) * along[2]) / squared, 0, 1
        )
        offset = [at - start[axis] - fraction * along[axis] for axis, at in enumerate((x, y, z))]
        return np.sqrt(offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2) - (first + fraction * (second - first))

    return distance


def ellipsoid(center: np.ndarray, half: np.ndarray) -> DistanceField:
    """An ellipsoid, exact to first order at its surface (Quilez, "Distance functions")."""

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        once = [(at - center[axis]) / half[axis] for axis, at in enumerate((x, y, z))]
        twice = [value / half[axis] for axis, value in enumerate(once)]
        level = np.sqrt(once[0] ** 2 + once[1] ** 2 + once[2] ** 2)
        slope = np.sqrt(twice[0] ** 2 + twice[1] ** 2 + twice[2] ** 2)
        return level * (level - 1) / np.maximum(slope, 1e-6)

    return distance


def rounded_box(lower: np.ndarray, upper: np.ndarray, rounding: float = 0.0) -> DistanceField:
    """A box with rounded edges."""
    center, half = (lower + upper) / 2, (upper - lower) / 2 - rounding

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        beyond = [np.abs(at - center[axis]) - half[axis] for axis, at in enumerate((x, y, z))]
        outside = np.sqrt(sum(np.maximum(one, 0) ** 2 for one in beyond))
        return outside + np.minimum(np.maximum(np.maximum(beyond[0], beyond[1]), beyond[2]), 0) - rounding

    return distance


def smooth_minimum(first: np.ndarray, second: np.ndarray, blend: float) -> np.ndarray:
    """The smaller of two distances, smooth where they differ by less than ``blend`` (Quilez, "Smooth minimum")."""
    if blend == 0:
        return np.minimum(first, second)
    near = np.maximum(blend - np.abs(first - second), 0)
    return np.minimum(first, second) - near * near / (4 * blend)
