"""The true distance of solids whose own value is only a bound, such as differences beside the edges of the cut."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.sdf.combine import Difference, Intersection, Union
from surfsup.sdf.marching_cubes import zero_set
from surfsup.sdf.mesh.query import MeshQuery
from surfsup.sdf.surface import Surface
from surfsup.sdf.transform import Transformed

RESOLUTION = 160  # cells of marching cubes along the longest side


def is_bound(surface: Surface) -> bool:
    """Whether the value outside is only a bound, because parts are intersected or cut off."""
    return any(isinstance(part, Intersection | Difference) for part in surface.modules())


def with_true_distances(surface: Surface, needs: Callable[[Surface], bool] = is_bound) -> Surface:
    """``surface`` with the true distance of each solid of a union that ``needs`` it.

    Each has a grid of its own, so that a thin cup keeps its walls beside a ground of several meters.

    Raises:
        InputError: The solid is not a union, and is empty.
    """
    if not needs(surface):
        return surface
    inner, frames = surface, []
    while isinstance(inner, Transformed):
        frames.append(inner)
        inner = inner.surface
    if not isinstance(inner, Union):
        return TrueDistance(surface)
    whole: Surface = Union(*(true_part(part, needs) for part in inner.parts))
    for frame in reversed(frames):
        whole = Transformed(whole, frame.rotation, frame.translation, frame.scale)
    return whole


def true_part(part: Surface, needs: Callable[[Surface], bool]) -> Surface:
    """A part of a union with its true distance; unchanged where the grid finds no point of it."""
    try:
        return with_true_distances(part, needs)
    except InputError:
        return part


class TrueDistance(Surface):
    """The solid of ``surface`` with its true distance, for queries of maps.

    The distance is that to triangles of the zero set, which cut off a sharp edge by up to half a cell of marching
    cubes. The sign is that of ``surface``, which is exact.

    Raises:
        InputError: The solid is empty.
    """

    def __init__(self, surface: Surface) -> None:
        super().__init__()
        self.surface = surface
        self.query = MeshQuery(*zero_set(surface, RESOLUTION))

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,), without a gradient."""
        bound = self.surface.distance(points).detach()
        to_mesh, _, _ = self.query.nearest(points.detach().cpu().double().numpy())
        return torch.copysign(torch.from_numpy(to_mesh).to(bound), bound)

    def bounds(self) -> Tensor:
        """The box of the surface (2, 3)."""
        return self.surface.bounds()
