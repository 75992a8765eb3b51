"""Edges, parts and open edges of triangles, without loops over them."""

from __future__ import annotations

import numpy as np


def used_vertices(faces: np.ndarray, vertex_count: int) -> np.ndarray:
    """Which vertices (V,) belong to a face; many times faster than ``numpy.unique``."""
    used = np.zeros(vertex_count, bool)
    used[faces] = True
    return used


def directed_edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Key (3 F,) of each face's edges, the same for both directions, and their direction (3 F,), 1 or -1.

    Edges are those from corner 0, then those from corner 1, then those from corner 2 of all faces.
    """
    start, end = faces.T.ravel(), np.roll(faces, -1, axis=1).T.ravel()
    count = int(faces.max(initial=0)) + 1
    return np.minimum(start, end) * count + np.maximum(start, end), np.where(start < end, 1, -1)


def open_edges(faces: np.ndarray) -> np.ndarray:
    """Which edges (3 F,) are open: not passed equally often in both directions by all faces together.

    Without open edges the winding number is an integer everywhere, also where several bodies share an edge.
    """
    keys, direction = directed_edges(faces)
    _, edge = np.unique(keys, return_inverse=True)
    return (np.bincount(edge, direction) != 0)[edge]


def parts_of(faces: np.ndarray, vertex_count: int) -> np.ndarray:
    """The part (F,) that each face belongs to: faces are of one part if a chain of shared vertices connects them."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    if len(faces) == 0:
        return np.zeros(0, np.int64)
    rows, columns = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    graph = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(vertex_count, vertex_count))
    _, label = connected_components(graph, directed=False)
    return np.unique(label[faces[:, 0]], return_inverse=True)[1]


def area_vectors(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Area times normal (F, 3) of each face."""
    corners = vertices[faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def signed_volumes(vertices: np.ndarray, faces: np.ndarray, group: np.ndarray, count: int) -> np.ndarray:
    """The volume (count,) that each group of faces encloses, negative if the group is inside out.

    For an open group it is the volume of the cone of its faces from their center.
    """
    centers = vertices[faces].mean(axis=1)
    vectors = area_vectors(vertices, faces)
    area = np.linalg.norm(vectors, axis=1)
    total = np.maximum(np.bincount(group, area, count), np.finfo(float).tiny)
    middle = np.stack([np.bincount(group, area * centers[:, axis], count) for axis in range(3)], axis=1)
    offset = centers - (middle / total[:, None])[group]
    return np.bincount(group, (offset * vectors).sum(axis=1) / 3, count)
