"""Constructive solid geometry: union, intersection, difference.

The minimum of two distances is the exact distance outside a union. Inside it, and everywhere for intersections and
differences, the result is only a bound: never too large in absolute value, with exact sign and zero set.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn

from surfsup import native
from surfsup.errors import InputError
from surfsup.sdf.surface import Surface


class Union(Surface):
    """Everything in any of ``parts``: exact distance outside, a bound inside.

    Examples:
        >>> import torch
        >>> from surfsup import Box, Sphere
        >>> points = torch.tensor([[0.0, 0.0, 0.5], [1.5, 0.0, 0.0]])
        >>> Union(Sphere(0.25), Box((2.0, 2.0, 0.25))).distance(points).tolist()
        [0.25, 0.5]
    """

    parts: Sequence[Surface]

    def __init__(self, *parts: Surface) -> None:
        super().__init__()
        self.parts = module_list("union", parts)

    def distance(self, points: Tensor) -> Tensor:
        """The smallest of the parts' distances (N,)."""
        return torch.stack([part.distance(points) for part in self.parts]).amin(dim=0)

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code; None if it does not support a part."""
        return native_operation("union", self.parts)

    @property
    def exact_outside(self) -> bool:
        """Whether every part is exact outside."""
        return all(part.exact_outside for part in self.parts)

    def bounds(self) -> Tensor:
        """The box around all parts (2, 3)."""
        boxes = torch.stack([part.bounds() for part in self.parts])
        return torch.stack([boxes[:, 0].amin(dim=0), boxes[:, 1].amax(dim=0)])


class Intersection(Surface):
    """Only what is in every one of ``parts``: a bound on the distance.

    Examples:
        >>> import torch
        >>> from surfsup import Box, Sphere
        >>> Intersection(Sphere(0.25), Box((2.0, 2.0, 0.25))).distance(torch.tensor([[0.0, 0.0, 0.5]])).item()
        0.375
    """

    parts: Sequence[Surface]

    def __init__(self, *parts: Surface) -> None:
        super().__init__()
        self.parts = module_list("intersection", parts)

    def distance(self, points: Tensor) -> Tensor:
        """The largest of the parts' distances (N,)."""
        return torch.stack([part.distance(points) for part in self.parts]).amax(dim=0)

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code; None if it does not support a part."""
        return native_operation("intersection", self.parts)

    @property
    def exact_outside(self) -> bool:
        """False: beside an edge where two parts meet the distance is larger."""
        return False

    def bounds(self) -> Tensor:
        """The intersection of the boxes of all parts (2, 3); empty if lower > upper."""
        boxes = torch.stack([part.bounds() for part in self.parts])
        return torch.stack([boxes[:, 0].amax(dim=0), boxes[:, 1].amin(dim=0)])


class Difference(Surface):
    """``base`` without ``cut``: a bound on the distance.

    Examples:
        >>> import torch
        >>> from surfsup import Sphere
        >>> bool(Difference(Sphere(0.5), Sphere(0.25)).distance(torch.zeros(1, 3)) > 0)  # a shell
        True
    """

    def __init__(self, base: Surface, cut: Surface) -> None:
        super().__init__()
        self.base, self.cut = base, cut

    def distance(self, points: Tensor) -> Tensor:
        """The larger of the distance to ``base`` and the negative distance to ``cut`` (N,)."""
        return torch.maximum(self.base.distance(points), -self.cut.distance(points))

    def native_solid(self) -> native.Solid | None:
        """The same solid for the native code; None if it does not support a part."""
        return native_operation("difference", (self.base, self.cut))

    @property
    def exact_outside(self) -> bool:
        """False: beside the edges of the cut the distance is larger."""
        return False

    def bounds(self) -> Tensor:
        """The box of ``base`` (2, 3)."""
        return self.base.bounds()


def native_operation(operation: str, parts: Sequence[Surface]) -> native.Solid | None:
    """The native solid of an operation on ``parts``; None if the native code does not support a part."""
    solids = []
    for part in parts:
        solid = part.native_solid()
        if solid is None:
            return None
        solids.append(solid)
    return native.Solid(operation, [], solids)


def module_list(operation: str, parts: tuple[Surface, ...]) -> Sequence[Surface]:
    """``parts`` as a module list, which torch does not type by its elements.

    Raises:
        InputError: There are none.
    """
    if not parts:
        raise InputError(f"{operation}: has no parts; list at least one surface")
    return cast(Sequence[Surface], nn.ModuleList(parts))
