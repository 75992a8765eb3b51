"""Sculpting: a signed distance on a grid, worked part by part, then turned into triangles."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import label

if TYPE_CHECKING:
    import trimesh

FAR = 1.0  # meters: what the grid holds where no part has come near
MARGIN = 3  # cells around a part in which the grid learns of it

Field = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
Point = tuple[float, float, float]


class Clay:
    """A block of space from ``lower`` to ``upper`` (meters) in cells of ``cell``, empty at first.

    Each part costs only the cells near it, so that thousands can be added. Fields take x, y and z, which can be
    broadcast against each other, and give a distance that need only be right near the part's surface.
    """

    def __init__(self, lower: Point, upper: Point, cell: float) -> None:
        self.cell = cell
        # The odd shift keeps flat faces off the grid points, where marching cubes would split vertices.
        start = np.array(lower) - (MARGIN + 0.618) * cell
        counts = np.ceil((np.array(upper) + (MARGIN + 0.618) * cell - start) / cell).astype(int)
        self.axes = [start[axis] + cell * np.arange(counts[axis]) for axis in range(3)]
        self.values = np.full(counts, FAR, dtype=np.float32)

    def add(self, field: Field, lower: np.ndarray, upper: np.ndarray, blend: float = 0.0) -> None:
        """Put on a part that lies between two corners, with a fillet of ``blend`` meters or less to the others."""
        window, where = self._window(lower, upper, blend)
        self.values[window] = smooth_minimum(self.values[window], field(*where), blend)

    def cut(self, field: Field, lower: np.ndarray, upper: np.ndarray, blend: float = 0.0) -> None:
        """Take away what is inside a part."""
        window, where = self._window(lower, upper, blend)
        self.values[window] = -smooth_minimum(-self.values[window], field(*where), blend)

    def carve(self, relief: Field, lower: np.ndarray, upper: np.ndarray) -> None:
        """Sink the surface between two corners by as many meters as ``relief`` says."""
        window, where = self._window(lower, upper, 0.0)
        self.values[window] += np.asarray(relief(*where), dtype=np.float32)

    def blob(self, ends: list[Point], radii: list[float], blend: float = 0.0) -> None:
        """Put on a round bar through ``ends``, as thick as ``radii`` (meters) at each of them."""
        places = np.array(ends, dtype=float)
        for start, end, thick, thin in zip(places[:-1], places[1:], radii[:-1], radii[1:], strict=True):
            widest = max(thick, thin)
            box = np.minimum(start, end) - widest, np.maximum(start, end) + widest
            self.add(bar(start, end, thick, thin), *box, blend)

    def ball(self, center: Point, radii: Point, blend: float = 0.0) -> None:
        """Put on an ellipsoid."""
        middle, half = np.array(center), np.array(radii)
        self.add(ellipsoid(middle, half), middle - half, middle + half, blend)

    def slab(self, lower: Point, upper: Point, rounding: float = 0.0, blend: float = 0.0) -> None:
        """Put on a box whose edges are rounded."""
        low, high = np.array(lower), np.array(upper)
        self.add(box(low, high, rounding), low, high, blend)

    def mesh(self) -> trimesh.Trimesh:
        """The largest piece, without cavities, as closed triangles in meters, by marching cubes."""
        import igl
        import trimesh

        counts = self.values.shape
        solid = self._one_solid()
        z, y, x = np.meshgrid(self.axes[2], self.axes[1], self.axes[0], indexing="ij")  # libigl wants x fastest
        grid = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
        values = np.ascontiguousarray(solid.T, dtype=np.float64).ravel()
        vertices, faces, *_ = igl.marching_cubes(values, grid, *counts, 0.0)
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        if mesh.volume < 0:
            mesh.invert()
        return mesh

    def _one_solid(self) -> np.ndarray:
        """The values without loose crumbs and without bubbles, which no water could reach."""
        crumbs, _ = label(self.values < 0)
        largest = np.bincount(crumbs[crumbs > 0]).argmax()
        values = np.where((crumbs > 0) & (crumbs != largest), self.cell, self.values)
        bubbles, _ = label(values >= 0)
        return np.where((bubbles > 0) & (bubbles != bubbles[0, 0, 0]), -self.cell, values)

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


def bar(start: np.ndarray, end: np.ndarray, thick: float, thin: float) -> Field:
    """A round bar from ``start`` to ``end`` whose radius changes evenly on the way."""
    along = end - start
    squared = max(float(along @ along), 1e-12)

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        share = np.clip(
            ((x - start[0]) * along[0] + (y - start[1]) * along[1] + (z - start[2]) * along[2]) / squared, 0, 1
        )
        off = [at - start[axis] - share * along[axis] for axis, at in enumerate((x, y, z))]
        return np.sqrt(off[0] ** 2 + off[1] ** 2 + off[2] ** 2) - (thick + share * (thin - thick))

    return distance


def ellipsoid(center: np.ndarray, half: np.ndarray) -> Field:
    """An ellipsoid; right to first order at its surface (Quilez, "Distance functions")."""

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        once = [(at - center[axis]) / half[axis] for axis, at in enumerate((x, y, z))]
        twice = [value / half[axis] for axis, value in enumerate(once)]
        level = np.sqrt(once[0] ** 2 + once[1] ** 2 + once[2] ** 2)
        slope = np.sqrt(twice[0] ** 2 + twice[1] ** 2 + twice[2] ** 2)
        return level * (level - 1) / np.maximum(slope, 1e-6)

    return distance


def box(lower: np.ndarray, upper: np.ndarray, rounding: float = 0.0) -> Field:
    """A box with rounded edges."""
    center, half = (lower + upper) / 2, (upper - lower) / 2 - rounding

    def distance(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        beyond = [np.abs(at - center[axis]) - half[axis] for axis, at in enumerate((x, y, z))]
        outside = np.sqrt(sum(np.maximum(one, 0) ** 2 for one in beyond))
        return outside + np.minimum(np.maximum(np.maximum(beyond[0], beyond[1]), beyond[2]), 0) - rounding

    return distance


def smooth_minimum(first: np.ndarray, second: np.ndarray, blend: float) -> np.ndarray:
    """The smaller of two distances, rounded off where they differ by less than ``blend`` (Quilez, "Smooth minimum")."""
    if blend == 0:
        return np.minimum(first, second)
    near = np.maximum(blend - np.abs(first - second), 0)
    return np.minimum(first, second) - near * near / (4 * blend)
