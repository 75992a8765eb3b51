"""The one interface of every solid: its signed distance."""

from __future__ import annotations

from abc import ABC, abstractmethod
from itertools import chain
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

from surfsup import native

if TYPE_CHECKING:
    import trimesh


class Surface(nn.Module, ABC):
    """A solid given by its signed distance function, negative inside.

    A surface is a torch module, so that shape parameters move between devices with ``.to`` and
    collect gradients. Lengths are meters. Where a subclass says that its value is only a bound,
    the zero set and the sign are still exact and the value is never larger in size than the distance.
    """

    @abstractmethod
    def distance(self, points: Tensor) -> Tensor:
        """Signed distance of ``points`` (N, 3) in meters, as (N,); negative inside the solid."""

    @abstractmethod
    def bounds(self) -> Tensor:
        """Lower and upper corner (2, 3) of an axis-aligned box that holds the solid, in meters."""

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and its unit gradient (N, 3), which points out of the solid.

        The normal is zero where the distance has no gradient (the center of a sphere). Both results are
        differentiable in whatever records gradients: the points, the shape's parameters.
        """
        found = self.look_natively(points)
        if found is not None:
            return found
        recording = self.is_recording(points)
        with torch.enable_grad():
            query = points if points.requires_grad else points.detach().requires_grad_()
            distance = self.distance(query)
            (gradient,) = torch.autograd.grad(distance.sum(), query, create_graph=recording)
        normal = nn.functional.normalize(gradient, dim=-1)
        return (distance, normal) if recording else (distance.detach(), normal)

    def look_natively(self, points: Tensor) -> tuple[Tensor, Tensor] | None:
        """Distance (N,) and normal (N, 3) in C++.

        None where that is not built, does not know the solid, or a gradient, another device or another precision
        is asked for.
        """
        solid = self.native_solid_for(points)
        if solid is None:
            return None
        points = points.detach().contiguous()
        distance, normal = points.new_empty(len(points)), torch.empty_like(points)
        solid.look(
            points.numpy(), distance.numpy(), normal.numpy(), native.instruction_sets()[0], torch.get_num_threads()
        )
        return distance, normal

    def distance_natively(self, points: Tensor) -> Tensor | None:
        """Distance (N,) in C++; None as of :meth:`look_natively`."""
        solid = self.native_solid_for(points)
        if solid is None:
            return None
        points = points.detach().contiguous()
        distance = points.new_empty(len(points))
        solid.look(points.numpy(), distance.numpy(), None, native.instruction_sets()[0], torch.get_num_threads())
        return distance

    def native_solid_for(self, points: Tensor) -> native.Solid | None:
        """The native solid, where it may be asked about ``points``."""
        if points.dtype != torch.float32 or points.device.type != "cpu" or not native.instruction_sets():
            return None
        return None if self.is_recording(points) else self.native_solid()

    def native_solid(self) -> native.Solid | None:
        """The solid as it is now, in C++; None for those that it does not know."""
        return None

    def is_recording(self, points: Tensor) -> bool:
        """Whether a gradient of the distance of ``points`` is wanted."""
        return torch.is_grad_enabled() and (points.requires_grad or self.records_gradients())

    def records_gradients(self) -> bool:
        """Whether any parameter of the shape (a module parameter or a buffer) wants a gradient."""
        return bool(self.recording())

    def recording(self) -> list[Tensor]:
        """The parameters of the shape (module parameters and buffers) that want a gradient, each once."""
        every = {id(tensor): tensor for tensor in chain(self.parameters(), self.buffers())}
        return [tensor for tensor in every.values() if tensor.requires_grad]

    @property
    def exact_outside(self) -> bool:
        """Whether the value outside the solid is the distance itself, not only a bound on it."""
        return True

    def to_mesh(self, resolution: int = 96) -> trimesh.Trimesh:
        """Triangles of the surface in meters: its own where it has some, else marching cubes.

        Args:
            resolution: cells of marching cubes along the longest side.

        Raises:
            InputError: nothing of the solid is larger than a cell.
        """
        from surfsup.sdf.marching_cubes import polygonize

        return polygonize(self, resolution)

    def forward(self, points: Tensor) -> Tensor:
        """The same as :meth:`distance`."""
        return self.distance(points)
