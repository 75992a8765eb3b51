"""The container: the box around everything, or none."""

from __future__ import annotations

from typing import Any

from pydantic import model_validator

from surfsup.scene.motion import Motion
from surfsup.scene.strict_model import Length, StrictModel

WALL_CELL = 0.05  # meters, approximately: cell size of the walls' boundary volume maps
OPEN = 1e5  # meters: where the walls of an open container are


class Container(StrictModel):
    """The box around everything: x and y centered on 0, floor at z = 0, sides ``size`` in meters.

    Attributes:
        size: sides, meters.
        open: no walls; ``size`` is then what pictures show.
        motion: how the box moves; None if it stands still.

    Examples:
        >>> Container(size=(2, 1, 1)).lower
        (-1.0, -0.5, 0.0)
    """

    size: tuple[Length, Length, Length] = (1.0, 1.0, 2.0)
    open: bool = False
    motion: Motion | None = None

    @model_validator(mode="before")
    @classmethod
    def accept_none(cls, values: Any) -> Any:
        """Take ``none`` for a container without walls."""
        return {"open": True} if isinstance(values, str) and values == "none" else values

    @model_validator(mode="after")
    def check_motion(self) -> Container:
        """Refuse the motion of walls that are not there."""
        if self.open and self.motion is not None:
            raise ValueError("an open container has no walls that could move; omit its motion")
        return self

    @property
    def lower(self) -> tuple[float, float, float]:
        """The corner with the smallest coordinates, meters."""
        return (-OPEN, -OPEN, -OPEN) if self.open else (-self.size[0] / 2, -self.size[1] / 2, 0.0)

    @property
    def upper(self) -> tuple[float, float, float]:
        """The corner with the largest coordinates, meters."""
        return (OPEN, OPEN, OPEN) if self.open else (self.size[0] / 2, self.size[1] / 2, self.size[2])
