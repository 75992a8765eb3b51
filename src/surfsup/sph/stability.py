"""When a fluid is no longer one: its particles have flown off, or see far more of each other than water does."""

from __future__ import annotations

import math

from surfsup.errors import SimulationError
from surfsup.scene import PARTICLE_RADIUS

MOST_CROWDED = 8  # times as many neighbors as in water, on the mean


def in_water(radius: float) -> float:
    """How many neighbors a particle has in water at rest."""
    return 4 / 3 * math.pi * (radius / (2 * PARTICLE_RADIUS)) ** 3


def max_edges(particles: int, radius: float) -> int:
    """With more edges than this the fluid is no longer one."""
    return int(MOST_CROWDED * in_water(radius) * particles)


def collapsed(radius: float) -> SimulationError:
    """What to raise where everybody sees everybody."""
    return SimulationError(
        f"the simulation collapsed: more than {MOST_CROWDED * in_water(radius):.0f} particles are within {radius} m of "
        f"one, on the mean, where water has {in_water(radius):.0f}"
    )


def blown_up() -> SimulationError:
    """What to raise where a position is not finite."""
    return SimulationError("the simulation blew up: a particle's position is not a finite number")
