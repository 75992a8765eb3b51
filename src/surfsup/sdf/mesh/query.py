"""The exact distance to a triangle mesh; every query walks a tree of boxes on the CPU."""

from __future__ import annotations

import numpy as np
import torch

from surfsup import native

ON_SURFACE = 1e-5  # of the mesh's largest extent: nearer than this, rounding decides where p - closest points


class MeshQuery:
    """Distance, sign and normal of points against triangles; the trees are built once and kept.

    The nearest triangle is found in C++ of our own, or by libigl where that is not built: libigl takes no bound on how
    far it can be, and holds Python's interpreter lock, so that threads do not make it faster. Inside and outside are
    libigl's. ``igl.signed_distance`` with FAST_WINDING_NUMBER would not do: it returns (1 - 2w) times the distance.

    Args:
        vertices: (V, 3) in meters.
        faces: (F, 3) indices, counterclockwise seen from outside.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        import igl

        self.vertices = np.ascontiguousarray(vertices, dtype=np.float64)
        self.faces = np.ascontiguousarray(faces, dtype=np.int64)
        if native.instruction_sets():
            self.triangles = native.Triangles(self.vertices, self.faces)
        else:
            self.tree = igl.AABB()
            self.tree.init(self.vertices, self.faces)
        self.winding = igl.FastWindingNumberBVH()
        self.winding.init(self.vertices, self.faces)
        self.extent = float(np.ptp(self.vertices, axis=0).max())
        self.face_normals, self.vertex_normals = normals_of(self.vertices, self.faces)

    def __reduce__(self) -> tuple[type[MeshQuery], tuple[np.ndarray, np.ndarray]]:
        return MeshQuery, (self.vertices, self.faces)  # libigl's trees can be neither copied nor pickled

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether each of ``points`` (N, 3) is in the solid, (N,): the winding number exceeds one half.

        Sound on meshes with holes, too (Barill et al., "Fast winding numbers for soups and clouds", 2018).
        """
        return self.winding.winding_number(points) > 0.5

    def nearest(
        self, points: np.ndarray, at_most: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Unsigned distance (N,), nearest face (N,) and the nearest point on it (N, 3).

        ``at_most`` (N,) may say how far, in meters, the surface can be from each point; that makes it faster.
        """
        if not native.instruction_sets():
            squared, face, closest = self.tree.squared_distance(self.vertices, self.faces, points)
            return np.sqrt(squared), face, closest
        points = np.ascontiguousarray(points, dtype=np.float64)
        distance, face, closest = np.empty(len(points)), np.empty(len(points), np.int64), np.empty_like(points)
        self.triangles.nearest(points, at_most, distance, face, closest, torch.get_num_threads())
        return distance, face, closest

    def normal(
        self,
        points: np.ndarray,
        distance: np.ndarray,
        face: np.ndarray,
        closest: np.ndarray,
        inside: np.ndarray,
    ) -> np.ndarray:
        """The unit gradient (N, 3) of the signed distance, from what the other methods said."""
        with np.errstate(divide="ignore", invalid="ignore"):
            normal = (points - closest) * (np.where(inside, -1.0, 1.0) / distance)[:, None]
        touching = np.flatnonzero(distance < ON_SURFACE * self.extent)
        if len(touching):
            normal[touching] = self.surface_normal(face[touching], closest[touching])
        return normal

    def surface_normal(self, face: np.ndarray, on_face: np.ndarray) -> np.ndarray:
        """The normal (N, 3) at points on the mesh: the face's own; on an edge or corner the mean around it.

        Around a corner faces count by their angle (Baerentzen and Aanaes, 2005), on an edge alike.
        """
        normal = self.face_normals[face].copy()
        share = barycentric(self.vertices[self.faces[face]], on_face)
        near_corner = share.max(axis=1) > 1 - 1e-4
        corner = self.faces[face, share.argmax(axis=1)]
        normal[near_corner] = self.vertex_normals[corner[near_corner]]
        on_edge = np.flatnonzero((share.min(axis=1) < 1e-4) & ~near_corner)
        for index in on_edge:
            ends = np.delete(self.faces[face[index]], share[index].argmin())
            around = (self.faces == ends[0]).any(axis=1) & (self.faces == ends[1]).any(axis=1)
            normal[index] = unit(self.face_normals[around].sum(axis=0))
        return normal


def normals_of(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals of the faces (F, 3) and the vertices (V, 3), where each face counts by its angle."""
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
    """How much of each corner (N, 3, 3) is in a point (N, 3) of its triangle: (N, 3), summing to one."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    across = np.cross(b - a, c - a)
    area = np.maximum((across * across).sum(axis=1), np.finfo(float).tiny)
    at_b = (np.cross(points - a, c - a) * across).sum(axis=1) / area
    at_c = (np.cross(b - a, points - a) * across).sum(axis=1) / area
    return np.stack([1 - at_b - at_c, at_b, at_c], axis=1)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Vectors of length one; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)
