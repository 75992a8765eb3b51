"""A surface scaled, turned and moved."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.sdf.primitives import positive
from surfsup.sdf.surface import Surface


class Transformed(Surface):
    """``surface`` scaled by ``scale``, then turned by ``rotation`` (3, 3), then moved by ``translation`` (3,).

    Rigid motions and uniform scale keep a true distance true: F(p) = s · f(Rᵀ(p - t) / s)
    (supplement, sections 5.1 and 5.5).
    """

    def __init__(
        self,
        surface: Surface,
        rotation: Tensor | None = None,
        translation: Sequence[float] | Tensor = (0.0, 0.0, 0.0),
        scale: float | Tensor = 1.0,
    ) -> None:
        super().__init__()
        self.surface = surface
        self.register_buffer("rotation", torch.eye(3) if rotation is None else torch.as_tensor(rotation))
        self.register_buffer("translation", torch.as_tensor(translation, dtype=self.rotation.dtype))
        self.register_buffer("scale", positive("transform", "scale", scale))

    def to_own_frame(self, points: Tensor) -> Tensor:
        """World points (N, 3) as seen by the surface before it was transformed."""
        return (points - self.translation) @ self.rotation / self.scale

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,), true where the surface's own is."""
        return self.scale * self.surface.distance(self.to_own_frame(points))

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and normal (N, 3), both asked of the surface in its own frame."""
        distance, normal = self.surface.distance_and_normal(self.to_own_frame(points))
        return self.scale * distance, normal @ self.rotation.T

    def bounds(self) -> Tensor:
        """The box (2, 3) around the transformed corners of the surface's own box."""
        lower, upper = self.surface.bounds()
        pick = torch.cartesian_prod(*[torch.tensor([False, True])] * 3).to(lower.device)
        corners = torch.where(pick, upper, lower) * self.scale @ self.rotation.T + self.translation
        return torch.stack([corners.amin(dim=0), corners.amax(dim=0)])


def axis_rotation(axis: Sequence[float] | Tensor, degrees: float | Tensor) -> Tensor:
    """The matrix (3, 3) that turns by ``degrees`` about ``axis`` (Rodrigues' formula), right-handed.

    Raises:
        InputError: the axis is zero or not finite.
    """
    direction = torch.as_tensor(axis, dtype=torch.get_default_dtype())
    norm = torch.linalg.vector_norm(direction)
    if not bool(torch.isfinite(norm)) or float(norm) == 0.0:
        raise InputError(f"rotate: axis is {direction.tolist()}, but must be a finite direction other than zero")
    x, y, z = direction / norm
    angle = torch.as_tensor(degrees, dtype=direction.dtype) * (math.pi / 180)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3)
    return torch.eye(3, dtype=direction.dtype) + torch.sin(angle) * cross + (1 - torch.cos(angle)) * cross @ cross
