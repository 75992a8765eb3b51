"""The interface of every solid: its signed distance."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

from surfsup import native
from surfsup.native.dispatch import needs_gradient
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.native_query import distance_and_normal_native

if TYPE_CHECKING:
    import trimesh


class Surface(nn.Module, ABC):
    """A solid given by its signed distance function, negative inside.

    A surface is a torch module: shape parameters move between devices with ``.to`` and collect gradients. Lengths are
    in meters. Some subclasses return only a bound on the distance. Sign and zero set of a bound are exact, and its
    absolute value is never larger than that of the distance.

    Examples:
        >>> import surfsup as sf, torch
        >>> class Plate(sf.Surface):  # a surface of one's own
        ...     def distance(self, points):
        ...         return points[:, 2].abs() - 0.05
        ...     def bounds(self):
        ...         return torch.tensor([[-9.0, -9.0, -0.05], [9.0, 9.0, 0.05]])
        >>> distance, normal = Plate().distance_and_normal(torch.tensor([[0.0, 0.0, 0.3]]))
        >>> distance.item(), normal.tolist()
        (0.25, [[0.0, 0.0, 1.0]])
    """

    @abstractmethod
    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,) in meters of ``points`` (N, 3); negative inside the solid."""

    @abstractmethod
    def bounds(self) -> Tensor:
        """Lower and upper corner (2, 3) of an axis-aligned box that contains the solid, in meters."""

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and its normalized gradient (N, 3), which points out of the solid.

        The normal is zero where the distance has no gradient, as in the center of a sphere. Both results are
        differentiable in the points and in the parameters of the shape.
        """
        result = distance_and_normal_native(self, points)
        if result is not None:
            return result
        differentiable = needs_gradient(points, module=self)
        with torch.enable_grad():
            query = points if points.requires_grad else points.detach().requires_grad_()
            distance = self.distance(query)
            (gradient,) = torch.autograd.grad(distance.sum(), query, create_graph=differentiable)
        normal = nn.functional.normalize(gradient, dim=-1)
        return (distance, normal) if differentiable else (distance.detach(), normal)

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code, with its present parameters; None for kinds it does not support."""
        return None

    def content(self) -> bytes | None:
        """A digest of all that the distance follows from; None for a surface without one, whose maps are not kept."""
        return None

    @property
    def exact_outside(self) -> bool:
        """Whether the value outside the solid is the exact distance rather than a bound."""
        return True

    def to_mesh(self, resolution: int = 96) -> trimesh.Trimesh:
        """The surface as triangles in meters: its own triangles if it has any, otherwise marching cubes.

        Args:
            resolution: Cells of marching cubes along the longest side.

        Raises:
            InputError: No part of the solid is larger than a cell.
        """
        return polygonize(self, resolution)

    def forward(self, points: Tensor) -> Tensor:
        """The same as :meth:`distance`."""
        return self.distance(points)
