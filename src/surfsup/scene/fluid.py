"""The fluid at the start: blocks on a cubic lattice of particles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydantic import model_validator

from surfsup.scene.strict_model import PositionVector, StrictModel, Velocity, for_callers_only

PARTICLE_RADIUS = 0.015  # meters
SPACING = 2 * PARTICLE_RADIUS
NEAR_SURFACE_DISTANCE = 6 * PARTICLE_RADIUS  # meters; a closer particle is near the surface (SURFSUP supplement)
MAX_PARTICLES = 50_000_000  # per block; their positions alone take 0.6 GB


class Block(StrictModel):
    """A box of fluid, ``Block(min, max, velocity=(0, 0, 0))``.

    Attributes:
        min, max: lower and upper corner in meters.
        velocity: initial velocity in m/s.

    Raises:
        InputError: the block is too thin for a particle or holds more than MAX_PARTICLES.

    Examples:
        >>> Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7), velocity=(0, 0, -1)).positions().shape
        (125, 3)
    """

    min: PositionVector
    max: PositionVector
    velocity: Velocity = (0.0, 0.0, 0.0)

    @for_callers_only
    def __init__(self, min: PositionVector, max: PositionVector, velocity: Velocity = (0.0, 0.0, 0.0)) -> None:
        super().__init__(min=min, max=max, velocity=velocity)

    @model_validator(mode="after")
    def check_particle_count(self) -> Block:
        """Require at least one lattice site along each axis, and at most MAX_PARTICLES in all."""
        sides = [(high - low) / SPACING for low, high in zip(self.min, self.max, strict=True)]
        if math.prod(max(1.0, side) for side in sides) > MAX_PARTICLES:
            raise ValueError(f"block would hold more than {MAX_PARTICLES:,} particles of {SPACING} m")
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if lattice_sites(low, high) < 1:
                raise ValueError(
                    f"block is {high - low:.3g} m thick along {axis}: "
                    f"it must be at least {2 * SPACING:.3g} m to hold a particle"
                )
        return self

    def particle_bounds(self) -> list[tuple[float, float]]:
        """Coordinates of the first and the last particle along x, y and z in meters."""
        return [
            (low + SPACING, low + SPACING * lattice_sites(low, high))
            for low, high in zip(self.min, self.max, strict=True)
        ]

    def positions(self) -> np.ndarray:
        """Particle positions (N, 3) float32 in meters, on the lattice of SPlisHSPlasH's fluid blocks."""
        axes = [
            low + SPACING * (1 + np.arange(lattice_sites(low, high)))
            for low, high in zip(self.min, self.max, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)


class Fluid(StrictModel):
    """One entry of ``fluid`` in a scene file."""

    block: Block


@dataclass(frozen=True)
class InitialParticles:
    """The particles of a scene at its start.

    Attributes:
        block_positions: positions (N, 3) float32 in meters, one array per block.
        block_velocities: velocity in m/s, one per block.
        excluded: number of lattice sites without a particle, because they overlap the solid or another block.
    """

    block_positions: list[np.ndarray]
    block_velocities: list[Velocity]
    excluded: int

    @property
    def positions(self) -> np.ndarray:
        """Positions (N, 3) float32 of all particles in meters."""
        return np.concatenate(self.block_positions)

    @property
    def velocities(self) -> np.ndarray:
        """Velocities (N, 3) float32 of all particles in m/s."""
        return np.concatenate(
            [
                np.broadcast_to(np.array(velocity, np.float32), positions.shape)
                for positions, velocity in zip(self.block_positions, self.block_velocities, strict=True)
            ]
        )


def lattice_sites(low: float, high: float) -> int:
    """Number of lattice sites along a side from ``low`` to ``high``: the whole spacings in it, minus one.

    SPlisHSPlasH places as many for a side of whole spacings. For other sides it rounds, so that particles may be up to
    half a spacing closer to the face of the block; this function rounds down.
    """
    return int(np.floor((high - low) / SPACING + 1e-4)) - 1
