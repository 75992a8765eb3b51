"""Queries of surfaces by the native code."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from surfsup import native
from surfsup.native.dispatch import can_run_native, fastest_isa

if TYPE_CHECKING:
    from surfsup.sdf.surface import Surface


def distance_native(surface: Surface, points: Tensor) -> Tensor | None:
    """Signed distance (N,) of ``points`` (N, 3) by the native code; None where torch must compute it."""
    solid = native_solid_for(surface, points)
    if solid is None:
        return None
    points = points.detach().contiguous()
    distance = points.new_empty(len(points))
    solid.evaluate(points.numpy(), distance.numpy(), None, fastest_isa(), torch.get_num_threads())
    return distance


def distance_and_normal_native(surface: Surface, points: Tensor) -> tuple[Tensor, Tensor] | None:
    """Signed distance (N,) and unit normal (N, 3) by the native code; None where torch must compute them."""
    solid = native_solid_for(surface, points)
    if solid is None:
        return None
    points = points.detach().contiguous()
    distance, normal = points.new_empty(len(points)), torch.empty_like(points)
    solid.evaluate(points.numpy(), distance.numpy(), normal.numpy(), fastest_isa(), torch.get_num_threads())
    return distance, normal


def native_solid_for(surface: Surface, points: Tensor) -> native.Solid | None:
    """The native solid if the native code can evaluate ``surface`` at ``points``."""
    return surface.native_solid() if can_run_native(points, module=surface) else None
