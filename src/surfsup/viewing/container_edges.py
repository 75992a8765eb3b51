"""The edges of the container, as thin lines on the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surfsup.viewing.camera import Camera
from surfsup.viewing.pixel_box import PixelBox
from surfsup.viewing.viewpoint import SUPERSAMPLING

_COLOR = np.array([0.30, 0.36, 0.42], np.float32)
_OPACITY = 0.55
_CLEARANCE = 0.01  # meters; the floor's edges are in the floor


@dataclass(frozen=True)
class ContainerEdges:
    """The samples (P,) on the edges, with their depth in meters and their opacity."""

    rows: np.ndarray
    columns: np.ndarray
    depth: np.ndarray
    opacity: np.ndarray

    @staticmethod
    def of(corners: np.ndarray, camera: Camera) -> ContainerEdges:
        """The twelve edges of a container with ``corners`` (8, 3): four of its floor, then four above them."""
        z = float(corners[:, 2].max())
        pairs = [(i, (i + 1) % 4) for i in range(4)]
        pairs += [(a + 4, b + 4) for a, b in pairs] + [(i, i + 4) for i in range(4)]
        width, height = (SUPERSAMPLING * side for side in camera.size)
        found = []
        for a, b in pairs:
            points = corners[a] + np.linspace(0, 1, 4 * max(width, height))[:, None] * (corners[b] - corners[a])
            pixels, depth = camera.project(points)
            opacity = _OPACITY * np.clip(1.0 - 0.75 * points[:, 2] / z, 0.2, 1.0)  # fades upwards
            for offset in ((0, 0), (1, 0), (0, 1), (1, 1)):
                column, row = np.floor(SUPERSAMPLING * pixels + offset - 0.5).astype(int).T
                visible = (column >= 0) & (column < width) & (row >= 0) & (row < height)
                found.append(np.stack([row, column, depth, opacity], 1)[visible])
        rows, columns, depth, opacity = np.concatenate(found).T
        _, first = np.unique(rows.astype(int) * width + columns.astype(int), return_index=True)
        return ContainerEdges(
            rows[first].astype(int), columns[first].astype(int), depth[first], opacity[first].astype(np.float32)
        )

    @staticmethod
    def none() -> ContainerEdges:
        """No edges: those of an open container."""
        return ContainerEdges(np.empty(0, int), np.empty(0, int), np.empty(0), np.empty(0, np.float32))

    def draw(self, picture: np.ndarray, fine_depth: np.ndarray, box: PixelBox) -> None:
        """Blend the edges into a box of a picture where nothing is in front of them.

        Args:
            picture: (3, h, w) of the box.
            fine_depth: (2 h, 2 w) of its samples, meters.
            box: of the picture.
        """
        height, width = picture.shape[1:]
        rows, columns = self.rows - SUPERSAMPLING * box.top, self.columns - SUPERSAMPLING * box.left
        inside = (rows >= 0) & (rows < SUPERSAMPLING * height) & (columns >= 0) & (columns < SUPERSAMPLING * width)
        rows, columns, depth = rows[inside], columns[inside], self.depth[inside]
        visible = depth < fine_depth[rows, columns] + _CLEARANCE
        pixels = rows[visible] // SUPERSAMPLING * width + columns[visible] // SUPERSAMPLING
        opacity = np.bincount(pixels, self.opacity[inside][visible], height * width).reshape(height, width)
        on_edge = opacity > 0
        share = opacity[on_edge].astype(np.float32) / SUPERSAMPLING**2
        picture[:, on_edge] += share * (_COLOR[:, None] - picture[:, on_edge])
