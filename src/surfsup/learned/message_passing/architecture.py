"""The sizes of a message-passing simulator."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class MessagePassingArchitecture:
    """The sizes of a message-passing simulator; they travel with its weights. The defaults are the paper's.

    The paper leaves the radius and the stride unsaid: 0.045 gives about nine neighbors to a particle of a lattice
    of 0.03, and keeps clear of the ties at 0.0424 and 0.052.

    Attributes:
        width: channels of every particle and every edge.
        layers: steps of message passing, each with weights of its own.
        radius: connectivity radius in meters.
        history: the T last moves that the network sees.
        stride: frames in a step.

    Raises:
        ValueError: a size that makes no sense, by name.
    """

    width: int = 128
    layers: int = 10
    radius: float = 0.045
    history: int = 4
    stride: int = 1

    def __post_init__(self) -> None:
        for name, most in (("width", 4096), ("layers", 100), ("history", 100), ("stride", 100)):
            within(name, getattr(self, name), most)
        if not isinstance(self.radius, float) or not 0 < self.radius < math.inf:
            raise ValueError(f"radius is {self.radius!r}")


def within(name: str, value: object, most: int) -> None:
    """Refuse what is no count from 1 to ``most``.

    Raises:
        ValueError: naming it.
    """
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= most:
        raise ValueError(f"{name} is {value!r}")


SIZES = {
    "paper": {"width": 128, "layers": 10},
    "small": {"width": 64, "layers": 5},
}
