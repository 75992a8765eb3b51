"""The layers of particles that flow from a tap.

A tap of area A gives the volume A v t in the time t. Its particles come in layers of n, each a lattice of spacing a
across the opening. All layers are b apart, with n a² = A and a² b = V, the volume of a particle. So the water has the
density at rest from the first layer on, and its flow is exactly A v: n V every b / v seconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

# Centers of a disc in a square lattice, in its spacings: a particle, the middle of a side, the middle of a cell.
CENTERS = ((0.0, 0.0), (0.5, 0.0), (0.5, 0.5))
TINY = 1e-12  # meters
ROUNDING = 1e-6  # of a spacing or an interval, by which equal distances or times may differ


@dataclass(frozen=True)
class Nozzle:
    """A tap as the layers of particles that leave it. Layer k passes the opening at start + (k + ½) interval.

    Attributes:
        center: (3,), of the opening, meters.
        axes: (3, 3), rows: two directions across the opening, and that of the water.
        sides: (n, 2) float64, meters; of the particles in the opening along the first two axes.
        half: (2,), half the extent of the opening along these axes, meters.
        is_disc: whether the opening is a disc, else a rectangle.
        speed: m/s.
        interval: between two layers, seconds.
        start, until: when the tap opens and closes, seconds.
        guide: how long a layer is guided before it flows freely, seconds.
        carrier: name of what carries it, in whose frame points and velocity are; None for the world.
        recycle: whether it gives only water that drains have taken.
        liquid: number of its liquid in the scene's mixture; 0 in a scene of one liquid.
    """

    center: np.ndarray
    axes: np.ndarray
    sides: np.ndarray
    half: np.ndarray
    is_disc: bool
    speed: float
    interval: float
    start: float
    until: float
    guide: float
    carrier: str | None = None
    recycle: bool = False
    liquid: int = 0

    @cached_property
    def points(self) -> np.ndarray:
        """(n, 3) float64, meters: of the particles in the opening."""
        return self.sides @ self.axes[:2] + self.center

    @property
    def velocity(self) -> np.ndarray:
        """(3,), m/s."""
        return self.speed * self.axes[2]

    def way_out(self, points: np.ndarray, front: float) -> tuple[np.ndarray, np.ndarray]:
        """The shortest way out of the water that a tap guides, for points in it.

        That water reaches from half the distance of two layers before the opening to as far beyond ``front``. From
        before the opening the way is sideways or back, from behind it sideways or ahead.

        Args:
            points: (N, 3), meters.
            front: of the first layer from the opening, meters.

        Returns:
            The ways (N, 3) in meters, zero outside; and which points (N,) leave ahead.
        """
        across, along = (points - self.center) @ self.axes[:2].T, (points - self.center) @ self.axes[2]
        back = -0.5 * self.interval * self.speed
        front -= back
        if self.is_disc:
            distance = np.hypot(*across.T)
            depth = self.half[0] - distance
            side = across / np.maximum(distance, TINY)[:, None]
        else:
            depths = self.half - np.abs(across)
            axis = depths.argmin(axis=1)
            depth = depths.min(axis=1)
            side = np.eye(2)[axis] * np.where(across < 0, -1.0, 1.0)
        length = np.where(along < 0, along - back, front - along)
        inside = (depth > 0) & (along > back) & (along < front)
        straight = inside & (length < depth)
        ahead = straight & (along >= 0)
        ways = (depth * (inside & ~straight))[:, None] * side @ self.axes[:2]
        ways += (length * straight * np.where(ahead, 1.0, -1.0))[:, None] * self.axes[2]
        return ways, ahead

    def layer_times(self, after: float, to: float) -> np.ndarray:
        """When layers pass the opening, after the time ``after`` and at the latest at ``to``, seconds."""
        first, end = self._layers(after, to)
        return self.start + (np.arange(first, end) + 0.5) * self.interval

    def count(self, after: float, to: float) -> int:
        """Number of particles that flow from it after the time ``after`` until ``to``."""
        first, end = self._layers(after, to)
        return len(self.points) * (end - first)

    def _layers(self, after: float, to: float) -> tuple[int, int]:
        """The first layer that passes the opening after a time, and the first after ``to``."""

        def passed(time: float) -> int:
            return max(0, math.floor((min(time, self.until) - self.start) / self.interval + 0.5 + ROUNDING))

        first = passed(after)
        return first, max(first, passed(to))


def disc_lattice(radius: float, spacing: float) -> tuple[np.ndarray, float]:
    """The points (n, 2) of a layer in a disc, and the distance between layers, meters.

    Of all square lattices with a symmetric place of the disc's center it is the one whose spacing is closest to that of
    the particles.
    """
    area = math.pi * radius**2 / spacing**2
    steps = np.arange(-math.ceil(1.2 * radius / spacing) - 2, math.ceil(1.2 * radius / spacing) + 3)
    lattice = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    best: np.ndarray = np.empty((0, 2))
    error = math.inf
    for center in CENTERS:
        sites = lattice + center
        sites = sites[np.argsort(np.hypot(*sites.T), kind="stable")]
        # A layer takes all sites at one distance from the center or none of them.
        counts = np.flatnonzero(np.diff(np.hypot(*sites.T)) > ROUNDING) + 1
        errors = np.abs(np.log(counts / area))
        if errors.min() < error:
            best, error = sites[: counts[errors.argmin()]], errors.min()
    side = spacing * math.sqrt(area / len(best))
    return side * best, spacing**3 / side**2


def rectangle_lattice(size: Sequence[float], spacing: float) -> tuple[np.ndarray, float]:
    """The points (n, 2) of a layer in a rectangle with sides ``size``, and the distance between layers, meters."""
    counts = [max(1, round(side / spacing)) for side in size]
    axes = [side * ((np.arange(count) + 0.5) / count - 0.5) for side, count in zip(size, counts, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    return points, spacing**3 * len(points) / math.prod(size)


def nozzle_axes(direction: Sequence[float], degrees: float = 0.0) -> np.ndarray:
    """Rows (3, 3): the two directions of a layer, the first one horizontal before the turn, and that of the water."""
    forward = np.array(direction, np.float64) / math.hypot(*direction)
    side = np.cross((0.0, 0.0, 1.0), forward)
    length = float(np.linalg.norm(side))
    side = np.array([1.0, 0.0, 0.0]) if length < ROUNDING else side / length
    other = np.cross(forward, side)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.stack([c * side + s * other, c * other - s * side, forward])
