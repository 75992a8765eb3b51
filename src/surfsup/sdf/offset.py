"""A surface grown or shrunk by a distance."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup import native
from surfsup.cache import digest
from surfsup.sdf.surface import Surface


class Offset(Surface):
    """``surface`` moved outward by ``distance`` meters, inward if that is negative: F(p) = f(p) - distance.

    The value outside a shrunk solid is a bound beside its edges, where f knows the distance to the larger one.
    """

    def __init__(self, surface: Surface, distance: float) -> None:
        super().__init__()
        self.surface, self.offset = surface, float(distance)

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,), meters."""
        return self.surface.distance(points) - self.offset

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and normal (N, 3), which is that of the surface."""
        distance, normal = self.surface.distance_and_normal(points)
        return distance - self.offset, normal

    def bounds(self) -> Tensor:
        """The box of the surface (2, 3), moved alike; not smaller than a point."""
        lower, upper = self.surface.bounds()
        middle = (lower + upper) / 2
        return torch.stack([torch.minimum(lower - self.offset, middle), torch.maximum(upper + self.offset, middle)])

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code; None if it does not support the surface."""
        solid = self.surface.native_solid()
        return None if solid is None else native.Solid("offset", [self.offset], [solid])

    def content(self) -> bytes | None:
        """A digest of the surface and the distance."""
        content = self.surface.content()
        return None if content is None else digest(type(self).__name__, content, repr(self.offset))

    @property
    def exact_outside(self) -> bool:
        """Whether the value outside is exact: only where the solid grows."""
        return self.offset >= 0 and self.surface.exact_outside
