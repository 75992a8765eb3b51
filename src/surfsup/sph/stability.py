"""Signs that a simulation has failed: particles at infinity, or clumps far denser than water."""

from __future__ import annotations

import math

from surfsup.errors import SimulationError
from surfsup.scene import PARTICLE_RADIUS

MAX_NEIGHBOR_RATIO = 8  # mean number of neighbors, in multiples of that in water


def neighbors_in_water(radius: float) -> float:
    """Number of neighbors within ``radius`` meters of a particle in water at rest."""
    return 4 / 3 * math.pi * (radius / (2 * PARTICLE_RADIUS)) ** 3


def max_pairs(particles: int, radius: float) -> int:
    """Number of neighbor pairs beyond which the particles have collapsed."""
    return int(MAX_NEIGHBOR_RATIO * neighbors_in_water(radius) * particles)


def check_pairs(pairs: int, particles: int, radius: float) -> None:
    """Refuse the result of a neighbor search that counts ``pairs``, -1 for a position that is not finite.

    Raises:
        SimulationError: a position is not finite, or the particles have collapsed.
    """
    if pairs < 0:
        raise not_finite()
    if pairs > max_pairs(particles, radius):
        raise SimulationError(
            f"the simulation collapsed: a particle has more than {MAX_NEIGHBOR_RATIO * neighbors_in_water(radius):.0f} "
            f"neighbors within {radius} m on average, where water has {neighbors_in_water(radius):.0f}"
        )


def not_finite() -> SimulationError:
    """The error for a position that is not finite."""
    return SimulationError("the simulation blew up: a particle's position is not a finite number")
