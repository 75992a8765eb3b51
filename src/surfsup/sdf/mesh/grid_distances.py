"""Exact distances to a mesh at the nodes of a grid."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from surfsup.activity import activity
from surfsup.cache import cached, digest
from surfsup.sdf.grid import CHUNK, SdfGrid, grid_nodes
from surfsup.sdf.mesh.query import MeshQuery
from surfsup.sdf.mesh.signs import nodes_inside


def mesh_grid(query: MeshQuery, cell: float, margin: float) -> SdfGrid:
    """A grid of exact distances and gradients for queries in double precision, see :func:`mesh_distances`.

    Those of a known mesh are read from the cache.
    """

    def compute() -> dict[str, np.ndarray]:
        values = (value.numpy() for value in mesh_distances(query, cell, margin))
        return dict(zip(("distance", "gradient", "lower"), values, strict=True))

    grid = f"on a grid with cells of {cell:.2g} m"
    with activity(f"computing the distances around a mesh of {len(query.faces)} triangles {grid}"):
        arrays = cached("grid", digest(query.vertices, query.faces, cell, margin), compute)
    distance, gradient, lower = (torch.from_numpy(arrays[name]) for name in ("distance", "gradient", "lower"))
    size = torch.from_numpy(np.ptp(query.vertices, axis=0) + 2 * margin)
    return SdfGrid(distance, gradient, lower, cell, center=lower + size / 2)


def mesh_distances(query: MeshQuery, cell: float, margin: float) -> tuple[Tensor, Tensor, Tensor]:
    """Exact signed distances to a mesh at the nodes of a grid that extends ``margin`` beyond its box.

    Returns:
        Distances (X, Y, Z), gradients (X, Y, Z, 3) and the first node (3,), float64.
    """
    lower = torch.from_numpy(query.vertices.min(axis=0) - margin)
    shape = tuple(np.ceil((np.ptp(query.vertices, axis=0) + 2 * margin) / cell).astype(int).tolist())
    shape = tuple(count + 1 for count in shape)
    nodes = grid_nodes(lower, cell, shape).numpy()
    parts = np.array_split(nodes, max(1, len(nodes) // CHUNK))
    nearest = [query.nearest(part) for part in parts]
    unsigned = np.concatenate([distance for distance, _, _ in nearest])
    sides = np.array_split(nodes_inside(query, nodes, unsigned.reshape(shape), cell), len(parts))
    gradients = [query.normal(part, *found, inside) for part, found, inside in zip(parts, nearest, sides, strict=True)]
    signed = np.where(np.concatenate(sides), -unsigned, unsigned)
    distances, normals = torch.from_numpy(signed), torch.from_numpy(np.concatenate(gradients))
    return distances.reshape(shape), normals.reshape(*shape, 3), lower
