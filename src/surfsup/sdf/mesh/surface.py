"""A triangle mesh as a signed distance function."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.cache import digest
from surfsup.errors import InputError
from surfsup.native.dispatch import is_built
from surfsup.sdf.grid import SdfGrid
from surfsup.sdf.mesh.grid_distances import mesh_grid
from surfsup.sdf.mesh.query import ON_SURFACE, MeshQuery, unit
from surfsup.sdf.mesh.topology import used_vertices
from surfsup.sdf.native_query import distance_and_normal_native, distance_native
from surfsup.sdf.surface import Surface

if TYPE_CHECKING:
    import trimesh

    from surfsup.sdf.mesh.device_query import DeviceQueries, DeviceQuery

NEAR_CELLS = 2.5  # cells from the surface within which the triangles are queried
MIN_AGREEMENT = 0.9  # length of the interpolated gradient below which the triangles are queried
FINE_MARGIN = 8  # cells by which the fine grid extends beyond the mesh
COARSENING = 4  # cell of the coarse grid over that of the fine one


class MeshSurface(Surface):
    """The solid enclosed by the triangles of ``mesh``; faces are counterclockwise as seen from outside.

    Accuracy, with a cell of (largest extent) / ``cells``, which is 0.0125 m for a mesh of 0.8 m:

    - Within about two cells of the surface, distance, closest point and normal are those of the triangles. The sign is
      right wherever the mesh is closed. Across a hole, the boundary follows the winding number and may be off by a
      cell.
    - The same holds where the normals of neighboring nodes disagree, as halfway between two parts of the surface,
      within eight cells of the mesh's bounding box.
    - Beyond that, distance and normal are interpolated (:class:`SdfGrid`).
    - Beyond eight cells from the bounding box the grid is four times coarser. Beyond one mesh size from the box the
      distance is an upper bound. ``benchmarks/mesh_distance.py`` measures the errors.

    With ``exact=True`` every query uses the triangles, which is several times slower. The grids are built at the first
    query, in one to two seconds for 50,000 triangles, or read from the :mod:`surfsup.cache`. On a GPU queries run in
    Warp (:mod:`surfsup.sdf.mesh.device_query`), those with ``exact=True`` on the CPU. A point that is not finite has
    distance NaN.

    The distance is differentiable in the points; its gradient is the unit normal. The normal is treated as constant:
    its derivative (the curvature, which is nonzero only beside edges and corners) is taken to be zero.

    Args:
        mesh: Vertices in meters.
        cells: Cells of the fine grid along the largest extent of the mesh.
        exact: Query the triangles at every point.

    Raises:
        InputError: The mesh has no triangles, or a vertex that is not finite.
    """

    box: Tensor

    def __init__(self, mesh: trimesh.Trimesh, cells: int = 64, exact: bool = False) -> None:
        super().__init__()
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
        if len(faces) == 0:
            raise InputError("mesh: has no triangles, so it encloses no solid")
        if not np.isfinite(vertices).all():
            raise InputError("mesh: has vertices that are not finite numbers")
        self.query = MeshQuery(vertices, faces)
        self.cells, self.exact = cells, exact
        self.grids: tuple[SdfGrid, SdfGrid] | None = None  # a tuple, so that they stay on the CPU
        self.device_queries: DeviceQueries | None = None
        used = vertices[used_vertices(faces, len(vertices))]
        box = np.stack([used.min(axis=0), used.max(axis=0)])
        self.register_buffer("box", torch.as_tensor(box, dtype=torch.float32))

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,); exact near the surface (see the class)."""
        distance = distance_native(self, points)
        return self.distance_and_normal(points)[0] if distance is None else distance

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and unit normal (N, 3) by one query; the normal carries no gradient."""
        result = distance_and_normal_native(self, points)
        if result is not None:
            return result
        if points.device.type != "cpu" and self.has_device_query:
            distance, normal = self.query_on_device(points.detach())
        else:
            values = self.query_points(points.detach().cpu().double().numpy())
            distance, normal = (torch.as_tensor(value).to(points.device, points.dtype) for value in values)
        return WithNormalAsGradient.apply(points, distance, normal), normal

    @property
    def has_device_query(self) -> bool:
        """Whether Warp can query the solid on a GPU."""
        return not self.exact

    def query_on_device(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance (N,) and normal (N, 3) of ``points`` (N, 3) where they are, by Warp."""
        from surfsup.sdf.mesh.device_query import DeviceQueries

        if self.device_queries is None:
            self.device_queries = DeviceQueries()
        return self.device_queries.evaluate(points, self.on_device)

    def on_device(self, like: Tensor) -> DeviceQuery:
        """The query for the device of a tensor."""
        from surfsup.sdf.mesh.device_query import MeshOnDevice

        grids = self.build_grids()
        return MeshOnDevice(self.query, grids, NEAR_CELLS * grids[0].cell, MIN_AGREEMENT, like)

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code, unless every query uses the triangles."""
        if self.exact or not is_built():
            return None
        fine, coarse = self.build_grids()
        return native.Solid.of_mesh(
            bvh=self.query.bvh,
            fine=fine.native_arguments(),
            coarse=coarse.native_arguments(),
            node_distance=fine.node_distance.flatten().numpy(),
            mesh_range=NEAR_CELLS * fine.cell,
            min_agreement=MIN_AGREEMENT,
            on_surface=ON_SURFACE * self.query.extent,
            query_undecided=self.write_undecided,
        )

    def write_undecided(self, points: np.ndarray, distance: np.ndarray, normal: np.ndarray) -> None:
        """Write distance (N,) and normal (N, 3) of ``points`` (N, 3) whose side the native code cannot decide.

        Such points are near the surface, or not finite.
        """
        fine, _ = self.build_grids()
        finite = np.isfinite(points).all(axis=1)
        distance[~finite] = normal[~finite] = np.nan
        distance[finite], normal[finite] = self.query_near_node(points[finite].astype(np.float64), fine)

    def content(self) -> bytes | None:
        """A digest of the triangles and of how they are queried; None for subclasses of others."""
        if not type(self).__module__.startswith("surfsup."):
            return None
        return digest(type(self).__name__, self.query.vertices, self.query.faces, self.cells, self.exact)

    def bounds(self) -> Tensor:
        """The bounding box of the triangles (2, 3)."""
        return self.box

    def to_mesh(self, resolution: int = 96) -> trimesh.Trimesh:
        """The triangles themselves, whatever the ``resolution``."""
        import trimesh

        return trimesh.Trimesh(self.query.vertices, self.query.faces, process=False)

    def query_points(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) and normal (N, 3) of ``points`` (N, 3) float64."""
        if len(points) == 0:
            return np.zeros(0), np.zeros((0, 3))
        finite = np.isfinite(points).all(axis=1)
        if not finite.all():
            distance, normal = self.query_points(np.where(finite[:, None], points, 0.0))
            return np.where(finite, distance, np.nan), np.where(finite[:, None], normal, np.nan)
        return self.query_exactly(points) if self.exact else self.query_grids(points)

    def query_grids(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) and normal (N, 3) by the grids; by the triangles for those points that need it."""
        fine, coarse = self.build_grids()
        distance, normal = np.empty(len(points)), np.empty((len(points), 3))
        in_fine = fine.contains(points)
        far, near = np.flatnonzero(~in_fine), np.flatnonzero(in_fine)
        if len(far):
            # As in SdfGrid.sample(), in NumPy.
            border = np.clip(points[far], coarse.lower.numpy(), coarse.upper.numpy())
            border_distance, gradient = coarse.interpolate(border)
            away = points[far] - border + border_distance[:, None] * unit(gradient)
            distance[far], normal[far] = np.linalg.norm(away, axis=1), unit(away)
        if len(near):
            distance[near], gradient = fine.interpolate(points[near])
            agreement = np.linalg.norm(gradient, axis=1)
            normal[near] = gradient / np.maximum(agreement, 1e-9)[:, None]
            unsure = near[(np.abs(distance[near]) < NEAR_CELLS * fine.cell) | (agreement < MIN_AGREEMENT)]
            if len(unsure):
                distance[unsure], normal[unsure] = self.query_near_node(points[unsure], fine)
        return distance, normal

    def query_near_node(self, points: np.ndarray, grid: SdfGrid) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) and normal (N, 3) by the triangles, given the exact distances at the nodes of ``grid``.

        The distance is at most that to the nearest node plus that of the node from the surface. As long as the node is
        nearer than the surface, no surface is between, and the point is on the same side as the node.
        """
        to_node, node = grid.nearest_node(points)
        node_distance = grid.node_distance.flatten().numpy()[node]
        inside = np.signbit(node_distance)
        distance, face, closest = self.query.nearest(points, to_node + np.abs(node_distance))
        unknown = np.flatnonzero(to_node >= distance)
        if len(unknown):
            inside[unknown] = self.inside(points[unknown])
        return self.signed(points, distance, face, closest, inside)

    def query_exactly(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) and normal (N, 3) by the triangles alone."""
        inside, max_distance = self.inside_and_max_distance(points)
        return self.signed(points, *self.query.nearest(points, max_distance), inside)

    def signed(
        self, points: np.ndarray, distance: np.ndarray, face: np.ndarray, closest: np.ndarray, inside: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance (N,) and normal (N, 3) from the nearest points on the mesh and the sides."""
        normal = self.query.normal(points, distance, face, closest, inside)
        return np.where(inside, -distance, distance), normal

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether each of ``points`` (N, 3) is inside the solid, (N,)."""
        return self.query.inside(points)

    def inside_and_max_distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """The same, and an upper bound (N,) of the distance in meters; None where no bound is known."""
        return self.inside(points), None

    def build_grids(self) -> tuple[SdfGrid, SdfGrid]:
        """The fine grid around the mesh and the coarse one around that, built at the first call."""
        if self.grids is None:
            cell = self.query.extent / self.cells
            fine = mesh_grid(self.query, cell, margin=FINE_MARGIN * cell)
            coarse = mesh_grid(self.query, COARSENING * cell, margin=self.query.extent)
            self.grids = (fine, coarse)
        return self.grids


class WithNormalAsGradient(torch.autograd.Function):
    """The distance as a function of the points, whose gradient is the normal."""

    @staticmethod
    def forward(context: Any, points: Tensor, distance: Tensor, normal: Tensor) -> Tensor:
        """Return the distance and keep the normal."""
        context.save_for_backward(normal)
        return distance

    @staticmethod
    def backward(context: Any, upstream: Tensor) -> tuple[Tensor, None, None]:
        """Chain rule: upstream (N,) times the normal (N, 3)."""
        (normal,) = context.saved_tensors
        return upstream[:, None] * normal, None, None
