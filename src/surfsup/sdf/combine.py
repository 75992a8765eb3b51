"""Solids made of solids: union, intersection, difference.

The minimum of two distances is the true distance outside a union; inside it, and everywhere for
intersections and differences, it is only a bound (never too large in size), with exact sign and zero set.
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor, nn

from surfsup import native
from surfsup.errors import InputError
from surfsup.sdf.surface import Surface


class Union(Surface):
    """All that is in any of ``parts``: true distance outside, a bound inside."""

    def __init__(self, *parts: Surface) -> None:
        super().__init__()
        self.parts = at_least_one("union", parts)

    def distance(self, points: Tensor) -> Tensor:
        """The smallest of the parts' distances (N,)."""
        return torch.stack([part.distance(points) for part in self.parts]).amin(dim=0)

    def native_solid(self) -> native.Solid | None:
        """The same in C++, if all parts have that."""
        return native_of("union", self.parts)

    @property
    def exact_outside(self) -> bool:
        """As far as every part's is."""
        return all(part.exact_outside for part in self.parts)

    def bounds(self) -> Tensor:
        """The box around all parts (2, 3)."""
        boxes = torch.stack([part.bounds() for part in self.parts])
        return torch.stack([boxes[:, 0].amin(dim=0), boxes[:, 1].amax(dim=0)])


class Intersection(Surface):
    """Only what is in every one of ``parts``: a bound on the distance."""

    def __init__(self, *parts: Surface) -> None:
        super().__init__()
        self.parts = at_least_one("intersection", parts)

    def distance(self, points: Tensor) -> Tensor:
        """The largest of the parts' distances (N,)."""
        return torch.stack([part.distance(points) for part in self.parts]).amax(dim=0)

    def native_solid(self) -> native.Solid | None:
        """The same in C++, if all parts have that."""
        return native_of("intersection", self.parts)

    @property
    def exact_outside(self) -> bool:
        """No: beside an edge where two parts meet the distance is larger."""
        return False

    def bounds(self) -> Tensor:
        """What the boxes of all parts share (2, 3); empty where lower > upper."""
        boxes = torch.stack([part.bounds() for part in self.parts])
        return torch.stack([boxes[:, 0].amax(dim=0), boxes[:, 1].amin(dim=0)])


class Difference(Surface):
    """``base`` with ``cut`` taken away: a bound on the distance."""

    def __init__(self, base: Surface, cut: Surface) -> None:
        super().__init__()
        self.base, self.cut = base, cut

    def distance(self, points: Tensor) -> Tensor:
        """Distance to what is inside ``base`` and outside ``cut`` (N,)."""
        return torch.maximum(self.base.distance(points), -self.cut.distance(points))

    def native_solid(self) -> native.Solid | None:
        """The same in C++, if all parts have that."""
        return native_of("difference", (self.base, self.cut))

    @property
    def exact_outside(self) -> bool:
        """No: beside an edge that was cut the distance is larger."""
        return False

    def bounds(self) -> Tensor:
        """The box of ``base`` (2, 3)."""
        return self.base.bounds()


def native_of(operation: str, parts: Iterable[Surface]) -> native.Solid | None:
    """The native solid of an operation on ``parts``; None where one of them has none."""
    solids = [part.native_solid() for part in parts]
    return None if None in solids else native.Solid(operation, [], solids)


def at_least_one(operation: str, parts: tuple[Surface, ...]) -> nn.ModuleList:
    """The parts as a module list.

    Raises:
        InputError: there are none.
    """
    if not parts:
        raise InputError(f"{operation}: has no parts; list at least one surface")
    return nn.ModuleList(parts)
