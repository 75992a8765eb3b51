"""The distance beside the edges of intersections and differences, where the larger value of two parts is too small.

Near a point both parts are taken as planes with the distances and normals of the parts there. If the nearest point of
one plane is outside the other part, the nearest point of the solid is on the edge where the planes meet. With distances
a, b and the cosine c of the angle between the normals its distance is √((a² + b² - 2abc) / (1 - c²)). That is exact for
planes, and for a plane that cuts a cylinder or a ball at a right angle; elsewhere it errs by the curvature. It is never
less than the larger value and at most twice that, so sign and zero set stay exact.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from surfsup import native
from surfsup.sdf.combine import Difference, Intersection, Union, native_operation
from surfsup.sdf.native_query import distance_and_normal_native, distance_native
from surfsup.sdf.surface import Surface
from surfsup.sdf.transform import Transformed
from surfsup.sdf.true_distance import is_bound

MAX_FACTOR = 2.0  # of the value at an edge over the larger one of the parts
MIN_SINE_SQUARED = 1e-3  # of the angle between two normals, below which the parts count as parallel


def with_edges(surface: Surface) -> Surface:
    """``surface`` with the distance beside edges of parts that are intersected or cut off; itself if there are none.

    Differences and intersections within each other become one intersection. What is inside a union inside an
    intersection stays a bound, so that no factor applies twice.
    """
    if not is_bound(surface):
        return surface
    if isinstance(surface, Transformed):
        return Transformed(with_edges(surface.surface), surface.rotation, surface.translation, surface.scale)
    if isinstance(surface, Union):
        return Union(*(with_edges(part) for part in surface.parts))
    if isinstance(surface, Intersection | Difference):
        return EdgedIntersection(*intersected(surface))
    return surface


def intersected(surface: Surface) -> Iterator[Surface]:
    """The solids whose intersection ``surface`` is."""
    if isinstance(surface, Intersection):
        for part in surface.parts:
            yield from intersected(part)
    elif isinstance(surface, Difference):
        yield from intersected(surface.base)
        cuts = surface.cut.parts if isinstance(surface.cut, Union) else [surface.cut]
        yield from (Complement(cut) for cut in cuts)
    else:
        yield surface


class Complement(Surface):
    """Everything outside ``part``."""

    def __init__(self, part: Surface) -> None:
        super().__init__()
        self.part = part

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,)."""
        return -self.part.distance(points)

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and normal (N, 3)."""
        distance, normal = self.part.distance_and_normal(points)
        return -distance, -normal

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code; None if it does not support the part."""
        return native_operation("complement", [self.part])

    def bounds(self) -> Tensor:
        """All of space (2, 3)."""
        return torch.tensor([[-torch.inf] * 3, [torch.inf] * 3])


class EdgedIntersection(Intersection):
    """What is in every one of ``parts``, with the distance beside their edges.

    Examples:
        >>> import torch
        >>> from surfsup import Box, Transformed
        >>> quarter = EdgedIntersection(Box((2.0, 2.0, 2.0)), Transformed(Box((2.0, 2.0, 2.0)), translation=(1, 1, 0)))
        >>> quarter.distance(torch.tensor([[-0.3, -0.4, 0.0]])).item()
        0.5
    """

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,)."""
        distance = distance_native(self, points)
        return self.distance_and_normal(points)[0] if distance is None else distance

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Signed distance (N,) and normal (N, 3), which points away from the nearest point, on an edge too."""
        result = distance_and_normal_native(self, points)
        if result is not None:
            return result
        distance, normal = self.parts[0].distance_and_normal(points)
        bound = distance
        for part in list(self.parts)[1:]:
            of_part, part_normal = part.distance_and_normal(points)
            bound = torch.maximum(bound, of_part)
            distance, normal = beside_edge((distance, normal), (of_part, part_normal), bound)
        return distance, normal

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code; None if it does not support a part."""
        return native_operation("edged_intersection", self.parts)


def beside_edge(first: tuple[Tensor, Tensor], second: tuple[Tensor, Tensor], bound: Tensor) -> tuple[Tensor, Tensor]:
    """Distance (N,) and normal (N, 3) of an intersection from those of two parts; ``bound`` (N,) is the larger value.

    Beside an edge the distance is that to the edge. Where both parts are equally far and parallel, the normal is the
    mean of both.
    """
    (a, a_normal), (b, b_normal) = first, second
    cosine = (a_normal * b_normal).sum(dim=-1)
    sine_squared = 1 - cosine * cosine
    at_edge = (a > cosine * b) & (b > cosine * a) & (a > 0) & (b > 0) & (sine_squared > MIN_SINE_SQUARED)
    room = sine_squared.clamp(min=MIN_SINE_SQUARED)
    along_a, along_b = (a - cosine * b) / room, (b - cosine * a) / room
    # One where there is no edge: the root of zero has no gradient.
    to_edge = torch.where(at_edge, along_a * a + along_b * b, torch.ones_like(a)).sqrt()
    direction = (along_a[:, None] * a_normal + along_b[:, None] * b_normal) / to_edge[:, None]
    share = torch.where(a > b, 1.0, torch.where(a == b, 0.5, 0.0)).to(a)[:, None]
    larger_normal = torch.nn.functional.normalize(share * a_normal + (1 - share) * b_normal, dim=-1)
    distance = torch.where(at_edge, torch.minimum(to_edge, MAX_FACTOR * bound), torch.maximum(a, b))
    return distance, torch.where(at_edge[:, None], direction, larger_normal)
