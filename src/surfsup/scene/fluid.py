"""Where the fluid is at the start."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydantic import model_validator

from surfsup.scene.shapes import Description, Vector

PARTICLE_RADIUS = 0.015  # meters
SPACING = 2 * PARTICLE_RADIUS
NEAR_SURFACE_DISTANCE = 6 * PARTICLE_RADIUS  # meters; a closer particle is near the surface (SURFSUP supplement)
MOST_PARTICLES = 50_000_000  # in a block; their positions alone are 0.6 GB


class Block(Description):
    """A box of fluid from ``min`` to ``max`` (meters) that starts with ``velocity`` (m/s)."""

    min: Vector
    max: Vector
    velocity: Vector = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def holds_a_particle(self) -> Block:
        """A block thinner than two spacings has no room for the lattice, a huge one none in memory."""
        sides = [(high - low) / SPACING for low, high in zip(self.min, self.max, strict=True)]
        if math.prod(max(1.0, side) for side in sides) > MOST_PARTICLES:
            raise ValueError(f"block would hold more than {MOST_PARTICLES:,} particles of {SPACING} m")
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if particles_along(low, high) < 1:
                raise ValueError(
                    f"block is {high - low:.3g} m thick along {axis}: "
                    f"it must be at least {2 * SPACING:.3g} m to hold a particle"
                )
        return self

    def particle_bounds(self) -> list[tuple[float, float]]:
        """Where the first and the last particle lie along x, y and z, meters."""
        return [
            (low + SPACING, low + SPACING * particles_along(low, high))
            for low, high in zip(self.min, self.max, strict=True)
        ]

    def positions(self) -> np.ndarray:
        """Particles (N, 3) float32 on the lattice that SPlisHSPlasH gives a block of whole spacings."""
        axes = [
            low + SPACING * (1 + np.arange(particles_along(low, high)))
            for low, high in zip(self.min, self.max, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)


class Fluid(Description):
    """One entry of a scene's ``fluid``."""

    block: Block


@dataclass(frozen=True)
class InitialParticles:
    """The particles of a scene on their lattice, at the velocities of their blocks.

    Attributes:
        blocks: positions (N, 3) float32 of each block in meters.
        velocities: velocity of each block in m/s.
        left_out: particles that would have lain in the solid or on one another.
    """

    blocks: list[np.ndarray]
    velocities: list[Vector]
    left_out: int

    @property
    def positions(self) -> np.ndarray:
        """All particles (N, 3) float32."""
        return np.concatenate(self.blocks)

    @property
    def velocities(self) -> np.ndarray:
        """The velocity of each particle (N, 3) float32 in m/s."""
        return np.concatenate(
            [
                np.broadcast_to(np.float32(velocity), block.shape)
                for block, velocity in zip(self.blocks, self.velocities, strict=True)
            ]
        )


def particles_along(low: float, high: float) -> int:
    """How many lattice places a side from ``low`` to ``high`` holds: whole spacings, less one.

    For whole spacings that is what SPlisHSPlasH puts into a fluid block. In between it rounds, and so may put
    particles up to half a spacing nearer to the block's face; we do not.
    """
    return int(np.floor((high - low) / SPACING + 1e-4)) - 1
