"""A surface that moves freely: what a scene file says of it, and its mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import torch
from pydantic import Field, model_validator

from surfsup.errors import InputError
from surfsup.scene.strict_model import Density, Finite, StrictModel, Vector, Velocity
from surfsup.sdf import Surface

CELLS = 48  # along the longest side of the box in which volume and inertia are summed
DEFAULT_DENSITY = 500.0  # kg/m³
Positive = Annotated[float, Field(gt=0, le=1e12, allow_inf_nan=False)]


class Axle(StrictModel):
    """A fixed axis that a body can only turn about, as a wheel or a door.

    Attributes:
        axis: its direction in the world, of any length but zero.
        point: a point on it in the world, meters; by default the center of mass at the start.
        damping: torque that brakes the turn, N m s.
    """

    axis: Vector
    point: Vector | None = None
    damping: Annotated[Finite, Field(ge=0)] = 0.0

    @model_validator(mode="after")
    def check_axis(self) -> Axle:
        """Require an axis."""
        if not any(self.axis):
            raise ValueError("axis must not be zero")
        return self


class RigidBody(StrictModel):
    """A body that gravity, water, walls and other solids move.

    Attributes:
        density: kg/m³; with the volume of the surface it gives the mass. 500 by default.
        mass: kg, instead of a density.
        center_of_mass: in the frame of the surface, meters; by default that of its volume.
        inertia: moments about the axes of the surface through the center of mass, kg m²; by default of the volume.
        velocity: at the start, m/s.
        angular_velocity: at the start, rad/s.
        axle: a fixed axis that it turns about; without one it moves freely.
    """

    density: Density | None = None
    mass: Positive | None = None
    center_of_mass: Vector | None = None
    inertia: tuple[Positive, Positive, Positive] | None = None
    velocity: Velocity = (0.0, 0.0, 0.0)
    angular_velocity: Velocity = (0.0, 0.0, 0.0)
    axle: Axle | None = None

    @model_validator(mode="after")
    def check_values(self) -> RigidBody:
        """Refuse a density beside a mass, and moments that no body has."""
        if self.density is not None and self.mass is not None:
            raise ValueError("give either density or mass, not both")
        if self.inertia is not None and 2 * max(self.inertia) > (1 + 1e-9) * sum(self.inertia):
            raise ValueError("inertia: no moment may exceed the sum of the other two")
        if self.axle is not None and any(self.velocity):
            raise ValueError("a body on an axle has no velocity of its own; give angular_velocity, or omit axle")
        return self


@dataclass(frozen=True)
class MassProperties:
    """Mass and its distribution, in the frame of a surface.

    Attributes:
        volume: m³.
        mass: kg.
        center: (3,) center of mass, meters.
        inertia: (3, 3) about the center of mass, kg m².
    """

    volume: float
    mass: float
    center: np.ndarray
    inertia: np.ndarray

    @classmethod
    def of(cls, body: RigidBody, surface: Surface, name: str) -> MassProperties:
        """The properties of a rigid body with a surface in its own frame.

        Volume, center and inertia are sums over a lattice; a cell at the surface counts by the part that its distance
        says is inside. They are right to a few parts in a thousand for solids of more than a few cells.

        Args:
            body: what the scene says.
            surface: in its own frame, meters.
            name: of the surface, for the message.

        Raises:
            InputError: the surface has no volume.
        """
        points, cell, part = occupied(surface)
        volume = float(part.sum()) * cell**3
        if not volume > 0:
            raise InputError(f"surface '{name}' is a rigid body, but encloses no volume; give it walls, see 'thicken'")
        mass = body.mass if body.mass is not None else (body.density or DEFAULT_DENSITY) * volume
        middle = (part[:, None] * points).sum(axis=0) / part.sum()
        center = middle if body.center_of_mass is None else np.array(body.center_of_mass)
        if body.inertia is not None:
            return cls(volume, mass, center, np.diag(body.inertia))
        arms = points - center
        weights = mass * part / part.sum()
        squares = np.einsum("n,ni,nj->ij", weights, arms, arms) + mass * cell**2 / 12 * np.eye(3)
        return cls(volume, mass, center, np.trace(squares) * np.eye(3) - squares)


def occupied(surface: Surface) -> tuple[np.ndarray, float, np.ndarray]:
    """Centers (N, 3) of lattice cells that are at least partly inside ``surface``, their side, and their parts (N,)."""
    lower, upper = surface.bounds().detach().cpu().double().numpy()
    cell = float((upper - lower).max()) / CELLS
    counts = np.maximum(1, np.ceil((upper - lower) / cell - 1e-6)).astype(int)
    middle = (lower + upper) / 2
    axes = [middle[k] + cell * (np.arange(counts[k]) - (counts[k] - 1) / 2) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    with torch.no_grad():
        distance = surface.distance(torch.from_numpy(points.astype(np.float32))).double().numpy()
    part = np.clip(0.5 - distance / cell, 0, 1)
    inside = part > 0
    return points[inside], cell, part[inside]
