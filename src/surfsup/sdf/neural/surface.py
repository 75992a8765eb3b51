"""What all neural surfaces share: the network near the surface, a grid far from it."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from surfsup import native
from surfsup.native.dispatch import needs_gradient
from surfsup.sdf.grid import SdfGrid
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.mesh.grid_distances import mesh_distances
from surfsup.sdf.mesh.query import MeshQuery
from surfsup.sdf.mesh.surface import MeshSurface
from surfsup.sdf.native_query import distance_and_normal_native, distance_native
from surfsup.sdf.neural.native_layers import NativeLayers
from surfsup.sdf.surface import Surface
from surfsup.sdf.transform import Transformed

if TYPE_CHECKING:
    import trimesh

# In units of the normalized shape, whose bounding cube has side 2.
NETWORK_RANGE = 0.1  # distance within which the network is evaluated; it was fitted there
GRID_CELL = 0.05
GRID_MARGIN = 0.25  # by which the grid extends beyond the solid
GRID_RESOLUTION = 64  # cells along the longest side of the mesh whose distances are on the grid
EXACT_RESOLUTION = 160  # cells along the longest side of the mesh that metrics use


class NeuralSurface(Surface):
    """A solid where a network is negative, in the network's own units: its bounding cube has side 2.

    The network is accurate at its zero set and near it. Elsewhere the distance comes from an :class:`SdfGrid` of
    exact distances to the mesh of the zero set, if there is one. With ``exact=True`` every query uses a finer mesh of
    the zero set; metrics are computed that way (supplement, section 6.1).

    Args:
        bounds: (2, 3) a box that contains the solid.
        grid: Distances far from the solid; None to evaluate the network everywhere.
    """

    box: Tensor

    def __init__(self, bounds: Tensor, grid: SdfGrid | None) -> None:
        super().__init__()
        self.register_buffer("box", bounds.float())
        self.grid = grid
        self.exact = False
        self.mesh_surface: MeshSurface | None = None

    @abstractmethod
    def value_and_gradient(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """The network's value (N,) and its gradient (N, 3) at ``points`` (N, 3), single precision."""

    @abstractmethod
    def value(self, points: Tensor) -> Tensor:
        """The network's value (N,) alone, which costs less."""

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,), by the network near the surface and by the grid elsewhere."""
        if self.exact:
            return self.exact_surface().distance(points)
        result = distance_native(self, points)
        if result is not None:
            return result
        single = points.float()
        if self.grid is None:
            return self.value(single).to(points.dtype)
        distance, _ = self.grid.sample(single)
        if points.device.type != "cpu":  # the host does not wait for a GPU to learn which points are near
            near = distance.detach().abs() < NETWORK_RANGE
            return torch.where(near, self.value(single), distance).to(points.dtype)
        near = torch.nonzero(distance.detach().abs() < NETWORK_RANGE).squeeze(-1)
        if len(near):
            distance = distance.index_copy(0, near, self.value(single[near]))
        return distance.to(points.dtype)

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and unit normal (N, 3) in one pass, both differentiable."""
        if self.exact:
            return self.exact_surface().distance_and_normal(points)
        result = distance_and_normal_native(self, points)
        if result is not None:
            return result
        with torch.set_grad_enabled(needs_gradient(points, module=self)):
            distance, gradient = self.network_or_grid(points.float())
            return distance.to(points.dtype), nn.functional.normalize(gradient, dim=-1).to(points.dtype)

    def network_or_grid(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance (N,) and gradient (N, 3), by the network near the surface and by the grid elsewhere."""
        if self.grid is None:
            return self.value_and_gradient(points)
        distance, gradient = self.grid.sample(points)
        if points.device.type != "cpu":
            near = distance.detach().abs() < NETWORK_RANGE
            near_distance, near_gradient = self.value_and_gradient(points)
            return torch.where(near, near_distance, distance), torch.where(near[:, None], near_gradient, gradient)
        near = torch.nonzero(distance.detach().abs() < NETWORK_RANGE).squeeze(-1)
        if len(near):
            near_distance, near_gradient = self.value_and_gradient(points[near])
            distance = distance.index_copy(0, near, near_distance)
            gradient = gradient.index_copy(0, near, near_gradient)
        return distance, gradient

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code, unless every query uses the mesh or the layers are not supported."""
        layers = self.native_layers()
        if self.exact or layers is None:
            return None
        grid = None if self.grid is None else self.grid.native_arguments()
        return native.Solid.of_network(**layers, grid=grid, network_range=NETWORK_RANGE)

    def native_layers(self) -> NativeLayers | None:
        """The layers for the native code; None for networks that it does not support."""
        return None

    def bounds(self) -> Tensor:
        """The box around the solid (2, 3)."""
        return self.box

    @property
    def exact_outside(self) -> bool:
        """False: the network's value approximates the distance."""
        return False

    def with_grid(self) -> NeuralSurface:
        """The same surface, with the grid and the bounding box of its present zero set; in place.

        Raises:
            InputError: The solid is empty.
        """
        mesh = polygonize(self, GRID_RESOLUTION)
        vertices = np.asarray(mesh.vertices)
        self.box = torch.tensor(np.stack([vertices.min(axis=0), vertices.max(axis=0)]), dtype=torch.float32)
        self.grid = grid_around(mesh)
        return self

    def exact_surface(self) -> MeshSurface:
        """The mesh of the zero set, queried exactly; extracted at the first call."""
        if self.mesh_surface is None:
            self.exact = False
            self.mesh_surface = MeshSurface(polygonize(self, EXACT_RESOLUTION), exact=True)
            self.exact = True
        return self.mesh_surface

    def to_mesh(self, resolution: int = 128) -> trimesh.Trimesh:
        """The zero set as triangles, by marching cubes."""
        if self.exact:
            return self.exact_surface().to_mesh()
        return polygonize(self, resolution)


def grid_around(mesh: trimesh.Trimesh) -> SdfGrid:
    """A grid of exact distances to ``mesh``, the zero set of a network in its own units."""
    query = MeshQuery(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    distance, _, lower = mesh_distances(query, GRID_CELL, GRID_MARGIN)
    return SdfGrid.from_distances(distance, lower, GRID_CELL)


def fit_surface(surface: NeuralSurface, largest_extent: float) -> Transformed:
    """``surface`` scaled to a largest extent in meters, centered on x = y = 0 and standing on z = 0.

    F_s(p) = s · F(p / s) (supplement, section 5.5). :func:`fit_mesh` does the same for meshes.
    """
    lower, upper = surface.bounds()
    scale = largest_extent / float((upper - lower).max())
    middle = (lower + upper) / 2
    foot = torch.stack([middle[0], middle[1], lower[2]])
    return Transformed(surface, None, -scale * foot, scale)
