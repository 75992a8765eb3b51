"""The exact distance to a triangle mesh by a bounding volume hierarchy, on the CPU."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch

from surfsup import native
from surfsup.native.dispatch import is_built
from surfsup.sdf.mesh.topology import open_edges

if TYPE_CHECKING:
    import igl

# Distance over the mesh's largest extent, below which rounding dominates the direction from the closest point.
ON_SURFACE = 1e-5
WINDING_CHUNK = 10_000  # points


class MeshQuery:
    """Distance, sign and normal of points with respect to triangles; the trees are built once.

    The nearest triangle is found by the native code, or by libigl if that is not built. The native code is faster: it
    takes an upper bound of the distance and releases Python's interpreter lock. Winding numbers are computed by libigl.
    ``igl.signed_distance`` with FAST_WINDING_NUMBER is no alternative: it returns (1 - 2w) times the distance.

    Args:
        vertices: (V, 3) in meters.
        faces: (F, 3) indices, counterclockwise as seen from outside.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        if is_built():
            self.bvh = native.TriangleBvh(self.vertices, self.faces)
        else:
            import igl

            self.tree = igl.AABB()
            self.tree.init(self.vertices, self.faces)
        self.extent = float(np.ptp(self.vertices, axis=0).max())

    @cached_property
    def _normals(self) -> tuple[np.ndarray, np.ndarray]:
        return normals_of(self.vertices, self.faces)

    @property
    def face_normals(self) -> np.ndarray:
        """Of the triangles, (F, 3)."""
        return self._normals[0]

    @property
    def vertex_normals(self) -> np.ndarray:
        """Of the vertices, (V, 3), of the triangles around each by their angles."""
        return self._normals[1]

    def __reduce__(self) -> tuple[type[MeshQuery], tuple[np.ndarray, np.ndarray]]:
        return MeshQuery, (self.vertices, self.faces)  # libigl's trees cannot be copied or pickled

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether each of ``points`` (N, 3) is inside the solid, (N,): its winding number exceeds one half.

        This works for meshes with holes, too (Barill et al., "Fast winding numbers for soups and clouds", 2018).
        """
        # In parts, since libigl holds Python's interpreter lock.
        parts = np.array_split(points, max(1, len(points) // WINDING_CHUNK))
        return np.concatenate([self.winding.winding_number(np.ascontiguousarray(part)) for part in parts]) > 0.5

    def nearest(
        self, points: np.ndarray, max_distance: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unsigned distance (N,), nearest face (N,) and the nearest point on it (N, 3).

        An upper bound ``max_distance`` (N,) of the distances in meters makes the query faster.
        """
        if not is_built():
            squared, face, closest = self.tree.squared_distance(self.vertices, self.faces, points)
            return np.sqrt(squared), face, closest
        points = np.ascontiguousarray(points, dtype=np.float64)
        distance, face, closest = np.empty(len(points)), np.empty(len(points), np.int64), np.empty_like(points)
        self.bvh.nearest(points, max_distance, distance, face, closest, torch.get_num_threads())
        return distance, face, closest

    def normal(
        self,
        points: np.ndarray,
        distance: np.ndarray,
        face: np.ndarray,
        closest: np.ndarray,
        inside: np.ndarray,
    ) -> np.ndarray:
        """The unit gradient (N, 3) of the signed distance, from the results of the other methods."""
        with np.errstate(divide="ignore", invalid="ignore"):
            normal = (points - closest) * (np.where(inside, -1.0, 1.0) / distance)[:, None]
        touching = np.flatnonzero(distance < ON_SURFACE * self.extent)
        if len(touching):
            normal[touching] = self.surface_normal(face[touching], closest[touching])
        return normal

    def surface_normal(self, face: np.ndarray, on_face: np.ndarray) -> np.ndarray:
        """The normal (N, 3) at points on the mesh: that of the face, or the mean around an edge or a vertex.

        Around a vertex, faces are weighted by their angle (Baerentzen and Aanaes, 2005); at an edge, equally.
        """
        normal = self.face_normals[face].copy()
        weight = barycentric(self.vertices[self.faces[face]], on_face)
        near_corner = weight.max(axis=1) > 1 - 1e-4
        corner = self.faces[face, weight.argmax(axis=1)]
        normal[near_corner] = self.vertex_normals[corner[near_corner]]
        on_edge = np.flatnonzero((weight.min(axis=1) < 1e-4) & ~near_corner)
        if len(on_edge):
            opposite = weight[on_edge].argmin(axis=1)
            corners = self.faces[face[on_edge]]
            rows = np.arange(len(on_edge))
            ends = np.stack([corners[rows, (opposite + 1) % 3], corners[rows, (opposite + 2) % 3]])
            normal[on_edge] = self.edge_normals(*ends)
        return normal

    def edge_normals(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """The mean normal (N, 3) of the faces around each edge from vertex ``start`` to ``end`` (N,)."""
        keys, order = self.edge_faces
        requested, inverse = np.unique(edge_keys(start, end, len(self.vertices)), return_inverse=True)
        first, last = np.searchsorted(keys, requested, side="left"), np.searchsorted(keys, requested, side="right")
        edge = np.repeat(np.arange(len(requested)), last - first)
        around = order[np.arange(len(edge)) - np.repeat(np.cumsum(last - first) - last, last - first)]
        normals = np.zeros((len(requested), 3))
        np.add.at(normals, edge, self.face_normals[around])
        return unit(normals)[inverse.ravel()]

    @cached_property
    def winding(self) -> igl.FastWindingNumberBVH:
        """The tree for winding numbers, which terrain does without."""
        import igl

        tree = igl.FastWindingNumberBVH()
        tree.init(self.vertices, self.faces)
        return tree

    @cached_property
    def is_closed(self) -> bool:
        """Whether no edge is open, so that winding numbers are integers."""
        return not open_edges(self.faces).any()

    @cached_property
    def edge_faces(self) -> tuple[np.ndarray, np.ndarray]:
        """The edges of all faces as sorted keys (3 F,), and the face (3 F,) of each."""
        keys = edge_keys(self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel(), len(self.vertices))
        order = np.argsort(keys, kind="stable")
        return keys[order], order // 3


def edge_keys(start: np.ndarray, end: np.ndarray, vertex_count: int) -> np.ndarray:
    """A number (N,) for each edge between the vertices ``start`` and ``end`` (N,), in either direction."""
    return np.minimum(start, end) * vertex_count + np.maximum(start, end)


def normals_of(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals of the faces (F, 3) and of the vertices (V, 3), the latter weighted by the angles of the faces."""
    corners = vertices[faces]
    face_normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    vertex_normals = np.zeros_like(vertices)
    for corner in range(3):
        forward = unit(corners[:, (corner + 1) % 3] - corners[:, corner])
        backward = unit(corners[:, (corner + 2) % 3] - corners[:, corner])
        angle = np.arccos(np.clip((forward * backward).sum(axis=1), -1, 1))
        np.add.at(vertex_normals, faces[:, corner], angle[:, None] * face_normals)
    return face_normals, unit(vertex_normals)


def barycentric(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (N, 3) of ``points`` (N, 3) in triangles with ``corners`` (N, 3, 3)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    across = np.cross(b - a, c - a)
    area = np.maximum((across * across).sum(axis=1), np.finfo(float).tiny)
    at_b = (np.cross(points - a, c - a) * across).sum(axis=1) / area
    at_c = (np.cross(b - a, points - a) * across).sum(axis=1) / area
    return np.stack([1 - at_b - at_c, at_b, at_c], axis=1)


def unit(vectors: np.ndarray) -> np.ndarray:
    """``vectors`` scaled to length one; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)
