"""What a model's training data were like, so that a scene unlike them can be told."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Scene

TOLERANCE = 0.01  # share by which a number may be out of the range that was seen
Range = tuple[float, float]


@dataclass(frozen=True)
class TrainingDomain:
    """Ranges over all that was trained on; every pair is least and most.

    Attributes:
        sides: of the containers along x and y, meters.
        heights: of the containers, meters.
        particles: how many.
        surfaces: kinds of solid, 'none' for an empty container.
        gravity: its strength, m/s².
        tilt: the most that gravity was off straight down, degrees.
        fastest: the fastest particle, m/s.
        frame_time: seconds.
        radius: of a particle, meters.
    """

    sides: Range
    heights: Range
    particles: Range
    surfaces: tuple[str, ...]
    gravity: Range
    tilt: float
    fastest: float
    frame_time: float = FRAME_TIME
    radius: float = PARTICLE_RADIUS

    @classmethod
    def of(cls, scene: Scene, particles: int, fastest: float) -> TrainingDomain:
        """What one scene shows."""
        x, y, z = scene.container.size
        strength, tilt = pull(scene)
        return cls(
            sides=(min(x, y), max(x, y)),
            heights=(z, z),
            particles=(particles, particles),
            surfaces=(scene.surface.kind if scene.surface else "none",),
            gravity=(strength, strength),
            tilt=tilt,
            fastest=fastest,
        )

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> TrainingDomain:
        """What was written as JSON.

        Raises:
            TypeError: it is no mapping, or a key is missing or unknown.
        """
        if not isinstance(data, dict):
            raise TypeError(f"what was seen is a mapping, not {data!r}")
        return cls(**{key: tuple(value) if isinstance(value, list) else value for key, value in data.items()})

    def joined(self, other: TrainingDomain) -> TrainingDomain:
        """What either has seen."""
        return TrainingDomain(
            sides=around(self.sides, other.sides),
            heights=around(self.heights, other.heights),
            particles=around(self.particles, other.particles),
            surfaces=tuple(sorted({*self.surfaces, *other.surfaces})),
            gravity=around(self.gravity, other.gravity),
            tilt=max(self.tilt, other.tilt),
            fastest=max(self.fastest, other.fastest),
            frame_time=self.frame_time,
            radius=self.radius,
        )

    def warning(self, scene: Scene) -> str | None:
        """What of ``scene`` the weights were not trained for and what they were, as one line; None if nothing.

        Its solid is not told of: a user's own is nearly always of a kind that training had not, and the simulators know
        a solid by its distance, not by its kind.
        """
        strange = self.unlike(scene)
        return self.complaint(strange) if strange else None

    def complaint(self, strange: Sequence[str]) -> str:
        """One line on what is ``strange`` to the weights, and what is not."""
        return f"the weights were not trained for {', '.join(strange)}; expect errors. Training saw {self.text()}"

    def unlike_solid(self, scene: Scene) -> list[str]:
        """The solid of ``scene`` where its kind was not seen, else nothing."""
        if scene.surface is None:
            return [] if "none" in self.surfaces else ["a container without a solid"]
        return [] if scene.surface.kind in self.surfaces else [f"a solid of kind '{scene.surface.kind}'"]

    def unlike(self, scene: Scene) -> list[str]:
        """What of ``scene`` besides its solid is out of what was seen."""
        x, y, z = scene.container.size
        strength, tilt = pull(scene)
        speed = max(math.hypot(*entry.block.velocity) for entry in scene.fluid)
        strange = []
        if not (within(x, self.sides) and within(y, self.sides) and within(z, self.heights)):
            strange.append(f"a container of {x:g} x {y:g} x {z:g} m")
        if not within(PARTICLE_RADIUS, (self.radius, self.radius)):
            strange.append(f"particles of radius {PARTICLE_RADIUS:g} m")
        if not within(FRAME_TIME, (self.frame_time, self.frame_time)):
            strange.append(f"frames of {FRAME_TIME:g} s")
        if not within(strength, self.gravity) or tilt > self.tilt + 1:
            strange.append(
                f"gravity of {strength:.3g} m/s²" + (f", {tilt:.0f}° off straight down" if tilt >= 1 else "")
            )
        if speed > (1 + TOLERANCE) * self.fastest:
            strange.append(f"water at {speed:.3g} m/s")
        return strange

    def text(self) -> str:
        """What was seen, in words."""
        return (
            f"containers {span(self.sides)} m wide and {span(self.heights)} m high, "
            f"{span(self.particles)} particles of radius {self.radius:g} m, frames of {self.frame_time:g} s, "
            f"gravity of {span(self.gravity)} m/s² up to {self.tilt:.0f}° off straight down, "
            f"water of up to {self.fastest:.3g} m/s, solids: {', '.join(self.surfaces)}"
        )


def pull(scene: Scene) -> tuple[float, float]:
    """The strength of gravity, m/s², and how far it is off straight down, degrees."""
    x, y, z = scene.gravity
    return math.hypot(x, y, z), math.degrees(math.atan2(math.hypot(x, y), -z)) if (x, y, z) != (0, 0, 0) else 0.0


def around(one: Range, other: Range) -> Range:
    """The smallest range that holds both."""
    return min(one[0], other[0]), max(one[1], other[1])


def within(value: float, seen: Range) -> bool:
    """Whether ``value`` is in the range, or all but."""
    return (1 - TOLERANCE) * seen[0] <= value <= (1 + TOLERANCE) * seen[1]


def span(seen: Range) -> str:
    """A range in words."""
    return f"{seen[0]:.4g}" if seen[0] == seen[1] else f"{seen[0]:.4g} to {seen[1]:.4g}"
