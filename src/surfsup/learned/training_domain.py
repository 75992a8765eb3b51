"""The range of a model's training data, to warn about scenes outside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from surfsup.checked.tensors import finite_number, plain_text
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Scene

MAX_NAME = 100  # characters
TOLERANCE = 0.01  # relative; a value this far outside a range still counts as inside
Range = tuple[float, float]


@dataclass(frozen=True)
class TrainingDomain:
    """Ranges over all training data; each range is a minimum and a maximum.

    Attributes:
        sides: of the containers along x and y, meters.
        heights: of the containers, meters.
        particles: numbers of particles.
        surfaces: kinds of surface, 'none' for an empty container.
        gravity: its magnitude, m/s².
        max_tilt: largest angle between gravity and straight down, degrees.
        max_speed: of a particle, m/s.
        frame_time: seconds.
        radius: of a particle, meters.
    """

    sides: Range
    heights: Range
    particles: Range
    surfaces: tuple[str, ...]
    gravity: Range
    max_tilt: float
    max_speed: float
    frame_time: float = FRAME_TIME
    radius: float = PARTICLE_RADIUS

    @classmethod
    def from_scene(cls, scene: Scene, particles: int, max_speed: float) -> TrainingDomain:
        """The domain of a single scene with that many particles and that maximum speed in m/s."""
        x, y, z = scene.container.size
        magnitude, tilt = gravity_magnitude_and_tilt(scene)
        return cls(
            sides=(min(x, y), max(x, y)),
            heights=(z, z),
            particles=(particles, particles),
            surfaces=(scene.surface_kind,),
            gravity=(magnitude, magnitude),
            max_tilt=tilt,
            max_speed=max_speed,
        )

    @classmethod
    def from_json(cls, data: Any) -> TrainingDomain:
        """The domain from its JSON.

        Raises:
            TypeError: it is not a mapping, or a key is missing or unknown.
            ValueError: a value is no such range or number; the message names it.
        """
        if not isinstance(data, dict):
            raise TypeError(f"a training domain is a mapping, not {data!r}")
        values: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list | tuple) else value for key, value in data.items()
        }
        domain = cls(**values)
        for name in ("sides", "heights", "particles", "gravity"):
            ends = getattr(domain, name)
            if not isinstance(ends, tuple) or len(ends) != 2:
                raise ValueError(f"{name} of the training domain is no range of two numbers")
            for end in ends:
                finite_number(f"{name} of the training domain", end)
        for name in ("max_tilt", "max_speed", "frame_time", "radius"):
            finite_number(f"{name} of the training domain", getattr(domain, name))
        if not isinstance(domain.surfaces, tuple):
            raise ValueError("surfaces of the training domain is no list of names")
        for kind in domain.surfaces:
            plain_text("a surface of the training domain", kind, MAX_NAME)
        return domain

    def union(self, other: TrainingDomain) -> TrainingDomain:
        """The smallest domain that contains both."""
        return TrainingDomain(
            sides=union_of_ranges(self.sides, other.sides),
            heights=union_of_ranges(self.heights, other.heights),
            particles=union_of_ranges(self.particles, other.particles),
            surfaces=tuple(sorted({*self.surfaces, *other.surfaces})),
            gravity=union_of_ranges(self.gravity, other.gravity),
            max_tilt=max(self.max_tilt, other.max_tilt),
            max_speed=max(self.max_speed, other.max_speed),
            frame_time=self.frame_time,
            radius=self.radius,
        )

    def warning(self, scene: Scene) -> str | None:
        """One line on how ``scene`` differs from the training data; None if it does not.

        The kind of surface is left out: most users' surfaces are of a kind that training did not have, and the models
        know a surface by its distance, not by its kind.
        """
        differences = self.differences(scene)
        return self.format_warning(differences) if differences else None

    def format_warning(self, differences: Sequence[str]) -> str:
        """One line with these differences and the training data."""
        return (
            f"the weights were not trained for {', '.join(differences)}; expect errors. "
            f"Training data: {self.describe()}"
        )

    def unknown_surface(self, scene: Scene) -> list[str]:
        """The surface of ``scene`` if training had none of its kind, else nothing."""
        if scene.surface is None:
            return [] if "none" in self.surfaces else ["a container without a surface"]
        return [] if scene.surface_kind in self.surfaces else [f"a surface of kind '{scene.surface_kind}'"]

    def differences(self, scene: Scene) -> list[str]:
        """The properties of ``scene`` outside the training data, except the kind of its surface.

        Sizes and speeds are compared in the units of the network, in which particles have the radius of training.
        """
        x, y, z = scene.container.size
        units = scene.units
        magnitude, tilt = gravity_magnitude_and_tilt(scene)
        speed = max((entry.speed for entry in scene.fluid), default=0.0)
        found = []
        side_x, side_y, height = (side / units.length for side in (x, y, z))
        if not (contains(self.sides, side_x) and contains(self.sides, side_y) and contains(self.heights, height)):
            found.append(f"a container of {x:g} x {y:g} x {z:g} m")
        if not contains((self.radius, self.radius), PARTICLE_RADIUS):
            found.append(f"particles of radius {PARTICLE_RADIUS:g} m")
        if not contains((self.frame_time, self.frame_time), FRAME_TIME):
            found.append(f"frames of {FRAME_TIME:g} s")
        if not contains(self.gravity, magnitude) or tilt > self.max_tilt + 1:
            direction = f", {tilt:.0f}° off straight down" if tilt >= 1 else ""
            found.append(f"gravity of {magnitude:.3g} m/s²{direction}")
        if speed / units.velocity > (1 + TOLERANCE) * self.max_speed:
            found.append(f"water at {speed:.3g} m/s")
        return found

    def describe(self) -> str:
        """The domain in words."""
        return (
            f"containers {format_range(self.sides)} m wide and {format_range(self.heights)} m high, "
            f"{format_range(self.particles)} particles of radius {self.radius:g} m, frames of {self.frame_time:g} s, "
            f"gravity of {format_range(self.gravity)} m/s² up to {self.max_tilt:.0f}° off straight down, "
            f"water of up to {self.max_speed:.3g} m/s, surfaces: {', '.join(self.surfaces)}"
        )


def gravity_magnitude_and_tilt(scene: Scene) -> tuple[float, float]:
    """The magnitude of gravity in m/s² and its angle to straight down in degrees."""
    x, y, z = scene.gravity
    return math.hypot(x, y, z), math.degrees(math.atan2(math.hypot(x, y), -z)) if (x, y, z) != (0, 0, 0) else 0.0


def union_of_ranges(one: Range, other: Range) -> Range:
    """The smallest range that contains both."""
    return min(one[0], other[0]), max(one[1], other[1])


def contains(values: Range, value: float) -> bool:
    """Whether ``value`` is in the range, up to the tolerance."""
    return (1 - TOLERANCE) * values[0] <= value <= (1 + TOLERANCE) * values[1]


def format_range(values: Range) -> str:
    """The range in words."""
    return f"{values[0]:.4g}" if values[0] == values[1] else f"{values[0]:.4g} to {values[1]:.4g}"
