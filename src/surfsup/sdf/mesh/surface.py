"""A triangle mesh as a signed distance function."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.sdf.mesh.distance_cache import DistanceCache
from surfsup.sdf.mesh.query import ON_SURFACE, MeshQuery
from surfsup.sdf.native_query import distance_and_normal_native, distance_native
from surfsup.sdf.surface import Surface

if TYPE_CHECKING:
    import trimesh

NEAR = 2.5  # cells: nearer to the surface than this the mesh itself is asked
AGREE = 0.9  # length of the mean of the normals around, below which the mesh itself is asked
FINE_MARGIN = 8  # cells that the fine grid reaches beyond the mesh
COARSE = 4  # fine cells in a coarse one


class MeshSurface(Surface):
    """The solid that the triangles of ``mesh`` enclose; faces are counterclockwise seen from outside.

    What is exact, with a cell of (largest extent) / ``cells``, that is 0.0125 m for a mesh of 0.8 m:

    - within about two cells of the surface distance, closest point and normal are the mesh's own;
      the sign is right wherever the mesh is closed. Across a hole the border, which the winding number draws,
      may be off by a cell;
    - so they are where the normals of neighboring nodes disagree (halfway between two parts of the surface),
      within eight cells of the mesh's box;
    - farther from the surface both are interpolated (:class:`DistanceCache`);
    - beyond eight cells from the mesh's box the grid is four times coarser, and beyond one mesh size from the
      box the distance is an upper bound. ``benchmarks/mesh_distance.py`` measures the errors.

    ``exact=True`` asks the mesh for every point instead, several times slower. The grids are built when first
    needed, in one to two seconds for 50,000 triangles. Queries run on the CPU whatever the device of the
    points, to which the answers are moved back. A point that is not finite has distance NaN.

    Gradients: the distance is differentiable in the points, with the unit normal as its gradient. The normal
    itself counts as constant, as it is beside a flat face: its own derivative (the curvature, which matters
    beside edges and corners only) is taken to be zero.

    Args:
        mesh: vertices in meters.
        cells: fine grid cells along the mesh's largest extent.
        exact: ask the mesh for every point.

    Raises:
        InputError: the mesh has no triangles or a vertex that is not finite.
    """

    def __init__(self, mesh: trimesh.Trimesh, cells: int = 64, exact: bool = False) -> None:
        super().__init__()
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
        if len(faces) == 0:
            raise InputError("mesh: has no triangles, so it bounds no solid")
        if not np.isfinite(vertices).all():
            raise InputError("mesh: has vertices that are not finite numbers")
        self.query = MeshQuery(vertices, faces)
        self.cells, self.exact = cells, exact
        self.caches: tuple[DistanceCache, DistanceCache] | None = None
        used = vertices[np.unique(faces)]
        box = np.stack([used.min(axis=0), used.max(axis=0)])
        self.register_buffer("box", torch.as_tensor(box, dtype=torch.float32))

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,); exact near the surface (see the class)."""
        found = distance_native(self, points)
        return self.distance_and_normal(points)[0] if found is None else found

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and unit normal (N, 3), by one query; the normal carries no gradient."""
        found = distance_and_normal_native(self, points)
        if found is not None:
            return found
        values = self.look_up(points.detach().cpu().double().numpy())
        distance, normal = (torch.as_tensor(value).to(points.device, points.dtype) for value in values)
        return WithNormalAsGradient.apply(points, distance, normal), normal

    def native_solid(self) -> native.Solid | None:
        """The same in C++, unless the mesh is asked for every point."""
        if self.exact or not is_built():
            return None
        fine, coarse = self.build_caches()
        return native.Solid.of_mesh(
            triangles=self.query.triangles,
            fine=fine.grid(),
            coarse=coarse.grid(),
            unsigned_distance=fine.unsigned,
            inside=fine.inside,
            near=NEAR * fine.cell,
            agree=AGREE,
            touching=ON_SURFACE * self.query.extent,
            rest=self.look_up_rest,
        )

    def look_up_rest(self, points: np.ndarray, distance: np.ndarray, normal: np.ndarray) -> None:
        """Write distance (N,) and normal (N, 3) of those ``points`` (N, 3) whose side the native code cannot tell."""
        distance[:], normal[:] = self.look_up(points.astype(np.float64))

    def bounds(self) -> Tensor:
        """The box around the triangles (2, 3)."""
        return self.box

    def to_mesh(self, resolution: int = 96) -> trimesh.Trimesh:
        """The triangles themselves, whatever the ``resolution``."""
        import trimesh

        return trimesh.Trimesh(self.query.vertices, self.query.faces, process=False)

    def look_up(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) and normal (N, 3) of ``points`` (N, 3) float64."""
        if len(points) == 0:
            return np.zeros(0), np.zeros((0, 3))
        finite = np.isfinite(points).all(axis=1)
        if not finite.all():
            distance, normal = self.look_up(np.where(finite[:, None], points, 0.0))
            return np.where(finite, distance, np.nan), np.where(finite[:, None], normal, np.nan)
        return self.ask(points, known=None) if self.exact else self.look_up_cached(points)

    def look_up_cached(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The grids' answer, and in its place the mesh's own for those points that need it."""
        fine, coarse = self.build_caches()
        distance, normal = np.empty(len(points)), np.empty((len(points), 3))
        in_fine = fine.holds(points)
        far, near = np.flatnonzero(~in_fine), np.flatnonzero(in_fine)
        if len(far):
            distance[far], normal[far] = coarse.reach(points[far])
        if len(near):
            distance[near], gradient = fine.sample(points[near])
            agreement = np.linalg.norm(gradient, axis=1)
            normal[near] = gradient / np.maximum(agreement, 1e-9)[:, None]
            unsure = near[(np.abs(distance[near]) < NEAR * fine.cell) | (agreement < AGREE)]
            if len(unsure):
                distance[unsure], normal[unsure] = self.ask(points[unsure], fine.nearest_node(points[unsure]))
        return distance, normal

    def ask(
        self, points: np.ndarray, known: tuple[np.ndarray, np.ndarray, np.ndarray] | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Distance and normal by the mesh itself.

        ``known`` may bring how far a place is (N,) whose own distance (N,) and side (N,) are known. The surface is no
        farther than both together; and as long as the place is nearer than the surface, no surface lies between, and
        the point is on the same side.
        """
        if known is None:
            inside, at_most = self.side(points)
            distance, face, closest = self.query.nearest(points, at_most)
        else:
            meters, beyond, inside = known
            distance, face, closest = self.query.nearest(points, meters + beyond)
            unknown = np.flatnonzero(meters >= distance)
            if len(unknown):
                inside[unknown] = self.inside(points[unknown])
        normal = self.query.normal(points, distance, face, closest, inside)
        return np.where(inside, -distance, distance), normal

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether each of ``points`` (N, 3) is in the solid, (N,)."""
        return self.query.inside(points)

    def side(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """The same, and how many meters (N,) the surface can be from each; None where that is not known beforehand."""
        return self.inside(points), None

    def build_caches(self) -> tuple[DistanceCache, DistanceCache]:
        """The fine grid around the mesh and the coarse one around that, built when first needed."""
        if self.caches is None:
            cell = self.query.extent / self.cells
            fine = DistanceCache(self.query, cell, margin=FINE_MARGIN * cell)
            coarse = DistanceCache(self.query, COARSE * cell, margin=self.query.extent)
            self.caches = (fine, coarse)
        return self.caches


class WithNormalAsGradient(torch.autograd.Function):
    """The distance as a function of the points, whose gradient is the normal that was found with it."""

    @staticmethod
    def forward(context: Any, points: Tensor, distance: Tensor, normal: Tensor) -> Tensor:
        """Pass the distance on, keep the normal."""
        context.save_for_backward(normal)
        return distance

    @staticmethod
    def backward(context: Any, upstream: Tensor) -> tuple[Tensor, None, None]:
        """Chain rule: upstream (N,) times the normal (N, 3)."""
        (normal,) = context.saved_tensors
        return upstream[:, None] * normal, None, None
