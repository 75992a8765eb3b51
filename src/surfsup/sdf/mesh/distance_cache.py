"""A grid that remembers distance and normal, for all who are too far from the mesh to ask it."""

from __future__ import annotations

import numpy as np
import torch

from surfsup import native
from surfsup.sdf.mesh.query import MeshQuery, unit


class DistanceCache:
    """Distance and normal at the nodes of a regular grid, and in between.

    Between nodes x_i with distance f_i and gradient g_i the value is Σ w_i (f_i + ½ g_i·(p - x_i)), w_i the
    trilinear weights. The plain trilinear mean errs by the curvature, the mean of the first-order expansions
    by as much the other way; half of each cancels it, which leaves an error of third order in the cell.

    Args:
        query: the mesh.
        cell: meters from node to node.
        margin: meters that the grid reaches beyond the mesh's box.
    """

    def __init__(self, query: MeshQuery, cell: float, margin: float) -> None:
        lower = query.vertices.min(axis=0) - margin
        size = np.ptp(query.vertices, axis=0) + 2 * margin
        shape = np.ceil(size / cell).astype(int) + 1
        x, y, z = (lower[axis] + cell * np.arange(shape[axis]) for axis in range(3))
        nodes = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
        distance, face, closest = query.nearest(nodes)
        inside = query.inside(nodes)
        gradient = query.normal(nodes, distance, face, closest, inside)
        signed = np.where(inside, -distance, distance)

        # f_i - ½ g_i·x_i, so that the mean is one look-up of four channels: T[a] + ½ p·T[g]. Positions are
        # taken from the middle of the grid, lest float32 lose digits far from the origin. NumPy, not torch:
        # on arrays this small torch's threads cost more than they save, far more on a busy machine.
        self.middle = lower + size / 2
        base = signed - 0.5 * (gradient * (nodes - self.middle)).sum(axis=1)
        self.table = np.column_stack([base, gradient]).astype(np.float32)
        self.unsigned, self.inside = distance, inside
        self.cell = cell
        self.lower, self.upper = lower, lower + cell * (shape - 1)
        self.last_cell = shape - 2
        self.stride = np.array([shape[1] * shape[2], shape[2], 1])
        self.corner_steps = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(8, 3) @ self.stride

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Which of ``points`` (N, 3) lie in the grid, (N,)."""
        return ((points >= self.lower) & (points <= self.upper)).all(axis=1)

    def sample(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) and gradient (N, 3) of points in the grid.

        The gradient is the trilinear mean of the nodes' and deliberately not of unit length: how far it falls
        short says how little the nodes around agree.
        """
        if native.instruction_sets():
            return self.sample_natively(points)
        place = (points - self.lower) / self.cell
        cell = np.minimum(place.astype(np.int64), self.last_cell)
        along = (place - cell).astype(np.float32)
        x, y, z = np.stack([1 - along, along], axis=-1).transpose(1, 0, 2)
        weight = (x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]).reshape(-1, 1, 8)
        corners = self.table[(cell @ self.stride)[:, None] + self.corner_steps]
        mean = np.matmul(weight, corners)[:, 0].astype(np.float64)
        gradient = mean[:, 1:]
        return mean[:, 0] + 0.5 * ((points - self.middle) * gradient).sum(axis=1), gradient

    def sample_natively(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same in C++."""
        points = np.ascontiguousarray(points)
        distance, gradient = np.empty(len(points)), np.empty_like(points)
        native.sample(self.grid(), points, distance, gradient, torch.get_num_threads())
        return distance, gradient

    def grid(self) -> tuple[np.ndarray, tuple[float, ...], tuple[float, ...], float, tuple[int, ...]]:
        """Table, first node, middle, cell and nodes along each axis, as the native code takes them."""
        return self.table, tuple(self.lower), tuple(self.middle), self.cell, tuple(self.last_cell + 2)

    def reach(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) and unit normal (N, 3) of any points outside the mesh's box, by the grid's border.

        Beyond the grid it is the distance to the surface point nearest to the nearest border point: never too
        small but for the grid's own error, too large by at most the size of the mesh.
        """
        border = np.clip(points, self.lower, self.upper)
        distance, gradient = self.sample(border)
        away = points - border + distance[:, None] * unit(gradient)
        return np.linalg.norm(away, axis=1), unit(away)

    def nearest_node(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Meters (N,) from points in the grid to the nearest node, that node's from the surface, and its side."""
        place = (points - self.lower) / self.cell
        node = place.round()
        number = node.astype(np.int64) @ self.stride
        return np.linalg.norm(place - node, axis=1) * self.cell, self.unsigned[number], self.inside[number]
