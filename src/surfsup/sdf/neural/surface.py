"""A surface that a network knows: what all of them share."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from surfsup import native
from surfsup.native.dispatch import needs_gradient
from surfsup.sdf.grid import Lattice
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.mesh.surface import MeshSurface
from surfsup.sdf.native_query import distance_and_normal_native, distance_native
from surfsup.sdf.neural.native_layers import NativeLayers
from surfsup.sdf.surface import Surface
from surfsup.sdf.transform import Transformed

if TYPE_CHECKING:
    import trimesh

NEAR = 0.1  # of a cube of side 2: nearer than this the network is asked, which was fitted there
CELL = 0.05  # of the lattice, in the same unit
MARGIN = 0.25  # that the lattice reaches beyond the solid
LATTICE_RESOLUTION = 64  # cells along the box of the mesh that the lattice is taken of
EXACT_RESOLUTION = 160  # cells along the longest side of the mesh that metrics are taken by


class NeuralSurface(Surface):
    """A solid that is where a network is negative, in the network's own unit: its cube has side 2.

    A network is trusted at its zero and near it. Farther off the distance comes from a :class:`Lattice` of exact
    distances to the mesh of that zero, where there is one. ``exact=True`` asks that mesh, as finely extracted, for
    every point: so the metrics judge (supplement, section 6.1).

    Args:
        bounds: (2, 3) a box that holds the solid.
        lattice: distances far from it; None leaves all to the network.
    """

    def __init__(self, bounds: Tensor, lattice: Lattice | None) -> None:
        super().__init__()
        self.register_buffer("box", bounds.float())
        self.lattice = lattice
        self.exact = False
        self.mesh_surface: MeshSurface | None = None

    @abstractmethod
    def field(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """The network's value (N,) and its gradient (N, 3) at ``points`` (N, 3), single precision."""

    @abstractmethod
    def value(self, points: Tensor) -> Tensor:
        """The network's value (N,) alone, which costs less."""

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,), by the network near the surface and by the lattice beyond."""
        if self.exact:
            return self.exact_surface().distance(points)
        found = distance_native(self, points)
        if found is not None:
            return found
        single = points.float()
        if self.lattice is None:
            return self.value(single).to(points.dtype)
        distance, _ = self.lattice.sample(single)
        near = torch.nonzero(distance.detach().abs() < NEAR).squeeze(-1)
        if len(near):
            distance = distance.index_copy(0, near, self.value(single[near]))
        return distance.to(points.dtype)

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and unit normal (N, 3) in one pass, both differentiable."""
        if self.exact:
            return self.exact_surface().distance_and_normal(points)
        found = distance_and_normal_native(self, points)
        if found is not None:
            return found
        with torch.set_grad_enabled(needs_gradient(points, module=self)):
            return self.look(points)

    def look(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance and normal, as far as gradients are recorded."""
        single = points.float()
        if self.lattice is None:
            distance, gradient = self.field(single)
        else:
            distance, gradient = self.lattice.sample(single)
            near = torch.nonzero(distance.detach().abs() < NEAR).squeeze(-1)
            if len(near):
                value, slope = self.field(single[near])
                distance, gradient = distance.index_copy(0, near, value), gradient.index_copy(0, near, slope)
        return distance.to(points.dtype), nn.functional.normalize(gradient, dim=-1).to(points.dtype)

    def native_solid(self) -> native.Solid | None:
        """The same in C++, unless the mesh is asked for every point or nothing is known of the layers."""
        layers = self.native_layers()
        if self.exact or layers is None:
            return None
        lattice = None if self.lattice is None else self.lattice.grid()
        return native.Solid.of_network(**layers, lattice=lattice, near=NEAR)

    def native_layers(self) -> NativeLayers | None:
        """The layers for the native code; None where they are none of those it knows."""
        return None

    def bounds(self) -> Tensor:
        """The box around the solid (2, 3)."""
        return self.box

    @property
    def exact_outside(self) -> bool:
        """No: the network's value is the distance only nearly."""
        return False

    def with_lattice(self) -> NeuralSurface:
        """The same, with a lattice and a box of its zero set as it is now; in place.

        Raises:
            InputError: it has no inside.
        """
        mesh = polygonize(self, LATTICE_RESOLUTION)
        vertices = np.asarray(mesh.vertices)
        self.box = torch.tensor(np.stack([vertices.min(axis=0), vertices.max(axis=0)]), dtype=torch.float32)
        self.lattice = Lattice.around(vertices, np.asarray(mesh.faces), CELL, MARGIN)
        return self

    def exact_surface(self) -> MeshSurface:
        """The mesh of the zero set, asked for every point; made when first needed."""
        if self.mesh_surface is None:
            self.exact = False
            self.mesh_surface = MeshSurface(polygonize(self, EXACT_RESOLUTION), exact=True)
            self.exact = True
        return self.mesh_surface

    def to_mesh(self, resolution: int = 128) -> trimesh.Trimesh:
        """Triangles of the zero set, by marching cubes."""
        if self.exact:
            return self.exact_surface().to_mesh()
        return polygonize(self, resolution)


def standing(surface: NeuralSurface, largest_extent: float) -> Transformed:
    """``surface`` so scaled that its largest extent is ``largest_extent`` meters, centered in x and y, on z = 0.

    F_s(p) = s · F(p / s) (supplement, section 5.5).
    """
    lower, upper = surface.bounds()
    scale = largest_extent / float((upper - lower).max())
    middle = (lower + upper) / 2
    foot = torch.stack([middle[0], middle[1], lower[2]])
    return Transformed(surface, None, -scale * foot, scale)
