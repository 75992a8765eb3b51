"""Boundary volume map of a scene's solid: signed distance and volume fraction, interpolated in cubic cells.

Bender et al., "Volume Maps: An Implicit Boundary Representation for SPH", 2019. The reference
solver uses the same values (:mod:`surfsup.sph.boundary.scene_boundaries`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.activity import activity
from surfsup.cache import cached, digest
from surfsup.scene import Container
from surfsup.sdf import Surface
from surfsup.sdf.true_distance import with_true_distances
from surfsup.sph.boundary.density import MIN_DEPTH, VOLUME_FACTOR
from surfsup.sph.boundary.scene_boundaries import map_in_container, whole_map
from surfsup.sph.boundary.shape_functions import CELL_NODES, shape_functions
from surfsup.sph.boundary.volume_map import NoSurfaceNear, VolumeMap
from surfsup.sph.kernels import KERNEL_SUPPORT

FULL_VOLUME = VOLUME_FACTOR * 4 / 3 * np.pi * KERNEL_SUPPORT**3  # m³: the map's volume inside a solid without end
NODES = len(CELL_NODES)
NO_ROTATION = np.eye(3, dtype=np.float32)


@dataclass(frozen=True)
class MapTables:
    """Values at the nodes of a map's stored cells.

    Attributes:
        lower: (3,) lowest corner of the grid, meters.
        cell: (3,) sides of a cell, meters.
        resolution: (3,) cells along each axis.
        cell_indices: (cells,) index of each grid cell among the stored ones, x fastest; -1 if it is not stored.
        nodes: (M + 1, 2, 32) distance in meters and volume fraction at the nodes of each stored cell. The last entry
            holds the values of a cell far from the solid.
    """

    lower: np.ndarray
    cell: np.ndarray
    resolution: np.ndarray
    cell_indices: np.ndarray
    nodes: np.ndarray

    @classmethod
    def of(cls, surface: Surface, container: Container) -> MapTables:
        """The reference's map of ``surface`` without deep cells; no cell where the solid is far from the container.

        If parts are cut off, the distance to triangles replaces the bound: with it, a hole drains 40 % too slowly.
        """

        def compute() -> MapTables:
            try:
                volume_map = map_in_container(with_true_distances(surface), container, -MIN_DEPTH)
            except NoSurfaceNear:
                lower, cell, resolution = np.zeros(3, np.float32), np.ones(3, np.float32), np.ones(3, np.int32)
                return cls(lower, cell, resolution, np.full(1, -1, np.int32), far_nodes())
            return cls.of_map(volume_map)

        return cls.known(surface, np.array([container.lower, container.upper]), compute)

    @classmethod
    def of_whole(cls, surface: Surface, name: str) -> MapTables:
        """The map of all of ``surface``, which moves under ``name``.

        Raises:
            InputError: the surface is too large, or has no point at all.
        """
        return cls.known(
            surface, "whole", lambda: cls.of_map(whole_map(with_true_distances(surface), name, -MIN_DEPTH))
        )

    @classmethod
    def known(cls, surface: Surface, extent: np.ndarray | str, compute: Callable[[], MapTables]) -> MapTables:
        """The tables of ``compute`` over an ``extent``; from the cache if the surface is known."""
        content = surface.content()
        with activity("computing the boundary volume map"):
            if content is None:
                return compute()
            return cls(**cached("boundary-map", digest(content, extent), lambda: vars(compute())))

    @classmethod
    def of_map(cls, volume_map: VolumeMap) -> MapTables:
        """The tables of a volume map."""
        cell_indices = np.full(int(volume_map.resolution.prod()), -1, np.int32)
        cell_indices[volume_map.cells] = np.arange(len(volume_map.cells))
        distances = volume_map.distances[volume_map.cell_nodes]
        fractions = volume_map.volumes[volume_map.cell_nodes] / FULL_VOLUME
        nodes = np.concatenate([np.stack([distances, fractions], axis=1).astype(np.float32), far_nodes()])
        lower, cell = volume_map.lower.astype(np.float32), volume_map.cell.astype(np.float32)
        return cls(lower, cell, volume_map.resolution.astype(np.int32), cell_indices, nodes)

    @cached_property
    def native(self) -> native.BoundaryMap:
        """A copy for C++ code."""
        return native.BoundaryMap(self.lower, self.cell, self.resolution, self.cell_indices, self.nodes)

    def on(self, device: torch.device, dtype: torch.dtype) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Lower corner, cell, resolution, cell indices and nodes as tensors on a device, real numbers in ``dtype``."""
        if (device, dtype) not in self._tensors:
            lower, cell, nodes = (
                torch.from_numpy(array).to(device, dtype) for array in (self.lower, self.cell, self.nodes)
            )
            resolution, indices = (torch.from_numpy(array).to(device) for array in (self.resolution, self.cell_indices))
            self._tensors[device, dtype] = lower, cell, resolution, indices, nodes
        return self._tensors[device, dtype]

    @cached_property
    def _tensors(self) -> dict[tuple[torch.device, torch.dtype], tuple[Tensor, Tensor, Tensor, Tensor, Tensor]]:
        return {}


class BoundaryMap:
    """Distance, volume fraction and normal of a scene's solid at any point.

    Args:
        make_tables: returns the tables. The first query calls it.
        rotation: (3, 3) orthogonal. Queries are rotated by its transpose, so that a map serves symmetric copies of its
            scene, too.
    """

    def __init__(self, make_tables: Callable[[], MapTables], rotation: np.ndarray = NO_ROTATION) -> None:
        self._make_tables, self.rotation = make_tables, rotation

    @classmethod
    def of(cls, surface: Surface, container: Container) -> BoundaryMap:
        """The map of ``surface``; its tables are made by the first query."""
        return cls(cache(lambda: MapTables.of(surface, container)))

    @classmethod
    def of_whole(cls, surface: Surface, name: str) -> BoundaryMap:
        """The map of all of ``surface``, which moves under ``name``; its tables are made by the first query.

        Raises:
            InputError: by that query: the surface is too large, or has no point at all.
        """
        return cls(cache(lambda: MapTables.of_whole(surface, name)))

    @property
    def tables(self) -> MapTables:
        """The values at the nodes."""
        return self._make_tables()

    def rotated(self, matrix: Tensor) -> BoundaryMap:
        """The map of the solid rotated or mirrored by an orthogonal ``matrix`` (3, 3)."""
        return BoundaryMap(self._make_tables, matrix.cpu().numpy().astype(np.float32) @ self.rotation)

    def query(self, points: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Distance (N,) in meters, volume fraction (N,) and normal (N, 3) at ``points`` (N, 3).

        Outside the stored cells the distance exceeds the kernel support, and volume fraction and normal are zero.
        """
        lower, cell, resolution, indices, nodes = self.tables.on(points.device, points.dtype)
        rotation = torch.from_numpy(self.rotation).to(points)
        coordinates = (points @ rotation - lower) / cell
        index = coordinates.detach().nan_to_num().floor()
        inside = ((index >= 0) & (index < resolution)).all(dim=-1)
        x, y, z = torch.where(inside[:, None], index, 0.0).long().unbind(dim=-1)
        number = indices[x + resolution[0] * (y + resolution[1] * z)].long()
        inside = inside & (number >= 0)
        values, gradients = shape_functions(torch.where(inside[:, None], 2 * (coordinates - index) - 1, 0.0))
        nodal = nodes[torch.where(inside, number, len(nodes) - 1)]
        distance, fraction = (nodal * values[:, None]).sum(dim=-1).unbind(dim=-1)
        gradient = torch.where(inside[:, None], (nodal[:, :1] * gradients).sum(dim=-1) / cell, 0.0)
        normal = torch.nn.functional.normalize(gradient, dim=-1) @ rotation.T
        return torch.where(points.isnan().any(dim=-1), torch.nan, distance), fraction, normal


def far_nodes() -> np.ndarray:
    """The nodes (1, 2, 32) of a cell far from the solid."""
    return np.stack([np.full(NODES, 10 * KERNEL_SUPPORT), np.zeros(NODES)])[None].astype(np.float32)
