"""Queries of triangle meshes and terrain on a device, by Warp; nothing waits for the device.

They compute in double precision, as those in C++ do, since a distance jumps by the error of the grid where the grid
takes over from the triangles: the side of that border must not depend on rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
import warp as wp
from torch import Tensor

from surfsup import warp_runtime as runtime
from surfsup.sdf.grid import SdfGrid
from surfsup.sdf.mesh.device_kernels import ROUNDING, mesh_kernels
from surfsup.sdf.mesh.query import ON_SURFACE, MeshQuery


class DeviceQueries:
    """The queries of one solid, for each device made at the first one; a copy makes its own."""

    def __init__(self) -> None:
        self._made: dict[torch.device, DeviceQuery] = {}

    def __reduce__(self) -> tuple[type[DeviceQueries], tuple[()]]:
        return DeviceQueries, ()  # Warp's arrays can be neither copied nor pickled

    def evaluate(self, points: Tensor, make: Callable[[Tensor], DeviceQuery]) -> tuple[Tensor, Tensor]:
        """Distance (N,) and normal (N, 3) of ``points`` (N, 3), by the query that ``make`` returns for their device."""
        double = points.double()
        if points.device not in self._made:
            runtime.load_for(mesh_kernels, double)
            self._made[points.device] = make(double)
        distance, normal = self._made[points.device].evaluate(double)
        return distance.to(points.dtype), normal.to(points.dtype)


class DeviceQuery:
    """The triangles of a mesh on a device.

    Args:
        query: the mesh.
        like: a tensor of the device.
    """

    def __init__(self, query: MeshQuery, like: Tensor) -> None:
        self.precision = runtime.precision_of(torch.float64)
        self.kernels, self.device = mesh_kernels(self.precision), runtime.warp_device(like.device)
        self.center = (query.vertices.min(axis=0) + query.vertices.max(axis=0)) / 2
        vertices = query.vertices - self.center
        single = torch.from_numpy(vertices).float().to(like.device)
        faces = torch.from_numpy(query.faces.astype(np.int32).ravel()).to(like.device)
        self.mesh = wp.Mesh(
            runtime.to_warp(single, wp.vec3f), runtime.to_warp(faces, wp.int32), support_winding_number=True
        )
        self.arrays = [self.on_device(values, like) for values in (vertices[query.faces], face_normals(query))]
        self.solid = self.kernels.Triangles()
        self.solid.mesh, self.solid.center = self.mesh.id, self.precision.vec3(*self.center.tolist())
        self.solid.rounding, self.solid.on_surface = ROUNDING * query.extent, ON_SURFACE * query.extent
        self.solid.corners, self.solid.normals = (runtime.to_warp(a, self.precision.vec3) for a in self.arrays)

    def on_device(self, values: np.ndarray, like: Tensor) -> Tensor:
        """An array as a tensor in double precision on the device."""
        return torch.from_numpy(np.ascontiguousarray(values, np.float64)).to(like.device)

    def evaluate(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and unit normal (N, 3) of ``points`` (N, 3), float64."""
        distance, normal = runtime.empty_like(points[:, 0]), runtime.empty_like(points)
        kernel, inputs = self.launch_inputs()
        vec3 = self.precision.vec3
        with runtime.on_stream(points.device):
            wp.launch(
                kernel,
                len(points),
                [runtime.to_warp(points, vec3), self.solid, *inputs],
                [runtime.to_warp(distance, self.precision.real), runtime.to_warp(normal, vec3)],
                device=self.device,
            )
        return distance, normal

    def launch_inputs(self) -> tuple[Any, list[Any]]:
        """The kernel, and what it reads beside the points and the triangles."""
        raise NotImplementedError


class MeshOnDevice(DeviceQuery):
    """A mesh with its grids.

    Args:
        query: the mesh.
        grids: the fine and the coarse one.
        mesh_range: distance below which the triangles are queried, meters.
        min_agreement: length of the grid's gradient below which they are, too.
        like: a tensor of the device.
    """

    def __init__(
        self, query: MeshQuery, grids: tuple[SdfGrid, SdfGrid], mesh_range: float, min_agreement: float, like: Tensor
    ) -> None:
        super().__init__(query, like)
        fine, coarse = (self.grid(grid, like) for grid in grids)
        self.node_distance = self.on_device(grids[0].node_distance.flatten().numpy(), like)
        nodes = runtime.to_warp(self.node_distance, self.precision.real)
        self.inputs = [fine, coarse, nodes, mesh_range, min_agreement]

    def grid(self, grid: SdfGrid, like: Tensor) -> Any:
        """A grid relative to the mesh's center, as the kernel takes it."""
        table, lower, center, cell, nodes = grid.native_arguments()
        self.arrays.append(torch.from_numpy(table).to(like.device))
        struct, vec3 = self.kernels.Grid(), self.precision.vec3
        first = np.array(lower) - self.center
        struct.lower, struct.upper = vec3(*first.tolist()), vec3(*(first + cell * (np.array(nodes) - 1)).tolist())
        struct.center, struct.cell = vec3(*(np.array(center) - self.center).tolist()), cell
        struct.nodes, struct.table = wp.vec3i(*nodes), runtime.to_warp(self.arrays[-1], wp.vec4f)
        return struct

    def launch_inputs(self) -> tuple[Any, list[Any]]:
        """Grids, and where the triangles are queried instead."""
        return self.kernels.query_mesh, self.inputs


class TerrainOnDevice(DeviceQuery):
    """A terrain with the heights of its samples.

    Args:
        query: its triangles.
        levels: (rows, columns) in meters.
        size: (2,) extent along x and y, meters.
        like: a tensor of the device.
    """

    def __init__(self, query: MeshQuery, levels: np.ndarray, size: np.ndarray, like: Tensor) -> None:
        super().__init__(query, like)
        self.levels = self.on_device(levels, like)
        self.inputs = [runtime.to_warp(self.levels, self.precision.real), self.precision.vec3(*size.tolist(), 0.0)]

    def launch_inputs(self) -> tuple[Any, list[Any]]:
        """Heights and extent."""
        return self.kernels.query_terrain, self.inputs


def face_normals(query: MeshQuery) -> np.ndarray:
    """Normals (F, 7, 3): of each face, at its corners, and at the edges opposite to them."""
    at_corners = query.vertex_normals[query.faces]
    ends = [(query.faces[:, (corner + 1) % 3], query.faces[:, (corner + 2) % 3]) for corner in range(3)]
    at_edges = np.stack([query.edge_normals(*edge) for edge in ends], axis=1)
    return np.concatenate([query.face_normals[:, None], at_corners, at_edges], axis=1)
