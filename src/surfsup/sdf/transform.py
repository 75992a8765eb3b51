"""A surface scaled, rotated and moved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from surfsup import native
from surfsup.cache import digest
from surfsup.errors import InputError
from surfsup.sdf.native_query import distance_and_normal_native
from surfsup.sdf.primitives import positive
from surfsup.sdf.surface import Surface

if TYPE_CHECKING:
    import trimesh


class Transformed(Surface):
    """``surface`` scaled by ``scale``, rotated by ``rotation`` (3, 3), then moved by ``translation`` (3,).

    Rigid motions and uniform scale keep an exact distance exact: F(p) = s · f(Rᵀ(p - t) / s)
    (supplement, sections 5.1 and 5.5).

    Examples:
        >>> import torch
        >>> from surfsup import Sphere
        >>> Transformed(Sphere(0.25), translation=(0, 0, 1)).distance(torch.zeros(1, 3)).item()
        0.75
    """

    rotation: Tensor
    translation: Tensor
    scale: Tensor

    def __init__(
        self,
        surface: Surface,
        rotation: Tensor | None = None,
        translation: Sequence[float] | Tensor = (0.0, 0.0, 0.0),
        scale: float | Tensor = 1.0,
    ) -> None:
        super().__init__()
        self.surface = surface
        self.register_buffer("rotation", torch.eye(3) if rotation is None else orthonormal(rotation))
        self.register_buffer("translation", offset_of(translation))
        self.register_buffer("scale", positive("transform", "scale", scale))

    def to_own_frame(self, points: Tensor) -> Tensor:
        """World ``points`` (N, 3) in the frame of the surface, in their own precision."""
        dtype = points.dtype
        return (points - self.translation.to(dtype)) @ self.rotation.to(dtype) / self.scale.to(dtype)

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,), exact where that of the surface is."""
        return self.scale * self.surface.distance(self.to_own_frame(points))

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and normal (N, 3), computed in the frame of the surface."""
        result = distance_and_normal_native(self, points)
        if result is not None:
            return result
        distance, normal = self.surface.distance_and_normal(self.to_own_frame(points))
        return self.scale * distance, normal @ self.rotation.T.to(normal.dtype)

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code; None if it does not support the surface."""
        solid = self.surface.native_solid()
        if solid is None:
            return None
        parameters = [*self.rotation.flatten().tolist(), *self.translation.tolist(), float(self.scale)]
        return native.Solid("transformed", parameters, [solid])

    def content(self) -> bytes | None:
        """A digest of the surface and its placement."""
        content = self.surface.content()
        if content is None:
            return None
        placement = (self.rotation, self.translation, self.scale)
        return digest(type(self).__name__, content, *(value.detach().cpu().numpy() for value in placement))

    @property
    def exact_outside(self) -> bool:
        """Whether the surface is exact outside."""
        return self.surface.exact_outside

    def bounds(self) -> Tensor:
        """The box (2, 3) around the transformed corners of the surface's bounding box."""
        lower, upper = self.surface.bounds()
        is_upper = torch.cartesian_prod(*[torch.tensor([False, True])] * 3).to(lower.device)
        corners = torch.where(is_upper, upper, lower) * self.scale
        corners = corners @ self.rotation.T.to(corners.dtype) + self.translation.to(corners.dtype)
        return torch.stack([corners.amin(dim=0), corners.amax(dim=0)])

    def to_mesh(self, resolution: int = 96) -> trimesh.Trimesh:
        """The transformed triangles of the surface."""
        mesh = self.surface.to_mesh(resolution)
        matrix = np.eye(4)
        matrix[:3, :3] = (self.scale * self.rotation).detach().cpu().numpy()
        matrix[:3, 3] = self.translation.detach().cpu().numpy()
        return mesh.apply_transform(matrix)


def axis_rotation(axis: Sequence[float] | Tensor, degrees: float | Tensor) -> Tensor:
    """The right-handed rotation matrix (3, 3) by ``degrees`` about ``axis`` (Rodrigues' formula).

    Differentiable in both arguments. The precision is the higher one of the arguments that are tensors.

    Raises:
        InputError: The axis is zero or not finite.
    """
    direction, angle = floating(axis, "axis", "3 numbers"), floating(degrees, "degrees", "a number") * (math.pi / 180)
    dtype = torch.promote_types(direction.dtype, angle.dtype)
    direction, angle = direction.to(dtype), angle.to(dtype)
    norm = torch.linalg.vector_norm(direction)
    if tuple(direction.shape) != (3,) or not bool(torch.isfinite(norm)) or float(norm.detach()) == 0.0:
        raise InputError(f"rotate: axis is {direction.tolist()}, but must be a finite direction other than zero")
    x, y, z = direction / norm
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero]).reshape(3, 3)
    identity = torch.eye(3, dtype=dtype, device=direction.device)
    return identity + torch.sin(angle) * cross + (1 - torch.cos(angle)) * cross @ cross


def orthonormal(rotation: Tensor) -> Tensor:
    """``rotation`` as a floating-point tensor; only rotations and reflections keep distances exact.

    Raises:
        InputError: It is not an orthogonal matrix (3, 3).
    """
    matrix = floating(rotation, "rotation", "an orthogonal matrix (3, 3)")
    valid = tuple(matrix.shape) == (3, 3) and bool(torch.isfinite(matrix).all())
    if valid:
        double = matrix.detach().double().cpu()
        valid = bool((double @ double.T - torch.eye(3, dtype=torch.float64)).abs().max() < 1e-3)
    if not valid:
        raise InputError(f"transform: rotation is {matrix.tolist()}, but must be an orthogonal matrix (3, 3)")
    return matrix


def offset_of(translation: Sequence[float] | Tensor) -> Tensor:
    """``translation`` as a floating-point tensor (3,).

    Raises:
        InputError: It is not three finite numbers.
    """
    offset = floating(translation, "translation", "3 finite numbers of meters")
    if tuple(offset.shape) != (3,) or not bool(torch.isfinite(offset.float()).all()):
        raise InputError(f"transform: translation is {offset.tolist()}, but must be 3 finite numbers of meters")
    return offset


def floating(value: object, name: str, expected: str) -> Tensor:
    """``value`` as a tensor: a floating-point one unchanged, anything else in the default precision.

    Raises:
        InputError: it holds what is no number.
    """
    try:
        tensor = torch.as_tensor(value)
    except (TypeError, ValueError, RuntimeError, OverflowError):
        raise InputError(f"transform: {name} is {value!r}, but must be {expected}") from None
    return tensor if tensor.is_floating_point() else tensor.to(torch.get_default_dtype())
