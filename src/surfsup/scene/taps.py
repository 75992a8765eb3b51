"""Taps, from which water enters a scene, and drains, in which it leaves."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator, model_validator

from surfsup.scene.liquid import Liquid, named_liquid
from surfsup.scene.nozzle import Nozzle, disc_lattice, nozzle_axes, rectangle_lattice
from surfsup.scene.shapes import Shape
from surfsup.scene.strict_model import MAX_SPEED, Degrees, Length, PositionVector, StrictModel, Vector

LITERS = 1000.0  # in a cubic meter
Positive = Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]
Time = Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)]


class DiscOpening(StrictModel):
    """A round opening; ``radius`` in meters."""

    radius: Length


class RectangleOpening(StrictModel):
    """A rectangular opening; ``size`` holds its two sides in meters, the first one horizontal."""

    size: tuple[Length, Length]


class Passage(StrictModel):
    """What lets water in or out for a while, and may ride on a surface.

    Attributes:
        start: when it opens, seconds (``from`` in a file).
        until: when it closes, seconds; None for never.
        carrier: name of the surface that carries it, in whose frame it is then; None for the world.
    """

    start: Time = Field(default=0.0, alias="from")
    until: Time | None = None
    carrier: str | None = None

    @model_validator(mode="after")
    def check_times(self) -> Any:
        """Require that it closes after it opens."""
        if self.until is not None and self.until <= self.start:
            raise ValueError(f"until {self.until:g} s must be after from {self.start:g} s")
        return self

    @property
    def end(self) -> float:
        """When it closes, seconds; infinite if it never does."""
        return math.inf if self.until is None else self.until


class Tap(Passage):
    """An opening from which water flows: ``disc`` or ``rectangle``, ``speed`` or ``flow``.

    Attributes:
        disc, rectangle: the opening.
        at: its center, meters.
        direction: of the water, of any length but zero.
        turn: rotation of a rectangle about the direction, degrees.
        speed: m/s.
        flow: liters a second.
        start: when it opens, seconds (``from`` in a file).
        until: when it closes, seconds; None for never.
        carrier: name of the surface that carries it, whose frame ``at`` and ``direction`` are in; None for the world.
        recycle: whether it gives only water that drains have taken.
        liquid: that of the tap, or its name; None for that of the scene.

    Examples:
        >>> import surfsup as sf
        >>> tap = Tap(disc={"radius": 0.05}, at=(0, 0, 1), flow=2, until=3)
        >>> scene = sf.Scene(taps=[tap], duration=1)
        >>> frame = list(sf.Simulation(scene).run())[-1]
        >>> round(len(frame.positions) * scene.spacing**3 * 1000)  # liters
        2
    """

    disc: DiscOpening | None = None
    rectangle: RectangleOpening | None = None
    at: PositionVector
    direction: Vector = (0.0, 0.0, -1.0)
    turn: Degrees = 0.0
    speed: Annotated[float, Field(gt=0, le=MAX_SPEED, allow_inf_nan=False)] | None = None
    flow: Positive | None = None
    recycle: bool = False
    liquid: Liquid | None = None

    @field_validator("liquid", mode="before")
    @classmethod
    def find_liquid(cls, value: Any) -> Any:
        """Take a name for the liquid that has it."""
        return named_liquid(value)

    @model_validator(mode="after")
    def check_tap(self) -> Tap:
        """Require one opening, a direction and one rate."""
        if (self.disc is None) == (self.rectangle is None):
            raise ValueError("needs exactly one of disc and rectangle")
        if (self.speed is None) == (self.flow is None):
            raise ValueError("give either speed in m/s or flow in liters a second")
        if math.hypot(*self.direction) == 0:
            raise ValueError("direction must not be zero")
        if self.meters_per_second > MAX_SPEED:
            raise ValueError(
                f"a flow of {self.flow:g} liters a second through {self.area:.3g} m² is {self.meters_per_second:.3g} "
                f"m/s; at most {MAX_SPEED:g} m/s"
            )
        return self

    @property
    def area(self) -> float:
        """Of the opening, m²."""
        if self.disc is not None:
            return math.pi * self.disc.radius**2
        assert self.rectangle is not None
        return math.prod(self.rectangle.size)

    @property
    def meters_per_second(self) -> float:
        """The speed of the water."""
        if self.speed is not None:
            return self.speed
        assert self.flow is not None
        return self.flow / LITERS / self.area

    def check_opening(self, spacing: float) -> None:
        """Refuse an opening that no particle fits through.

        Args:
            spacing: of the particles, meters.

        Raises:
            ValueError: naming the smallest size.
        """
        if self.disc is not None and self.disc.radius < 0.5 * spacing:
            raise ValueError(
                f"disc: a radius of {self.disc.radius:g} m is less than that of a particle, {spacing / 2:g} m"
            )
        if self.rectangle is not None and min(self.rectangle.size) < spacing:
            side = min(self.rectangle.size)
            raise ValueError(f"rectangle: a side of {side:g} m is less than the diameter of a particle, {spacing:g} m")

    def nozzle(self, spacing: float) -> Nozzle:
        """The layers of particles that flow from it.

        Args:
            spacing: of the particles, meters.
        """
        if self.disc is not None:
            sides, distance = disc_lattice(self.disc.radius, spacing)
            size = (2 * self.disc.radius, 2 * self.disc.radius)
        else:
            assert self.rectangle is not None
            size = self.rectangle.size
            sides, distance = rectangle_lattice(size, spacing)
        speed = self.meters_per_second
        return Nozzle(
            center=np.array(self.at),
            axes=nozzle_axes(self.direction, self.turn),
            sides=sides,
            half=0.5 * np.array(size),
            is_disc=self.disc is not None,
            speed=speed,
            interval=distance / speed,
            start=self.start,
            until=self.end,
            guide=2 * spacing / speed,
            carrier=self.carrier,
            recycle=self.recycle,
        )


class Drain(Passage, Shape):
    """A region of any shape that takes the water which enters it.

    Attributes:
        start: when it opens, seconds (``from`` in a file).
        until: when it closes, seconds; None for never.
        carrier: name of the surface that carries it, in whose frame the shape is then; None for the world.

    Examples:
        >>> import surfsup as sf
        >>> hole = Drain(box={"size": (0.2, 0.2, 0.1)}, at=(0, 0, 0.05))
        >>> block = sf.Block((-0.1, -0.1, 0.05), (0.1, 0.1, 0.2))
        >>> frames = list(sf.Simulation(sf.Scene(fluid=[block], drains=[hole])).run(seconds=0.5))
        >>> len(frames[0].ids) > len(frames[-1].ids)
        True
    """
