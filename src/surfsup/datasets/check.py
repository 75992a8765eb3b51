"""Whether a simulation is physical, asked frame by frame while it runs."""

from __future__ import annotations

import math

import numpy as np
import torch

from surfsup.datasets.density import number_density
from surfsup.scene import Scene
from surfsup.sdf import Surface

# Of 87 scenes 81 gained at most 0.02 J/kg; those that a wrong boundary kicked gained 0.11 to 2.8.
ENERGY_GAIN = 0.05
# The solver keeps water from being compressed: in 24 scenes, every tenth frame, the densest particle had 1.008 times
# the lattice's number density, and 38 neighbours within 0.06 m instead of 32.
DENSITY_CEILING = 1.05
DENSITY_EVERY = 25  # frames: looking takes 2 ms, and what clumps stays clumped
# As a multiple of what the fall from the highest particle to the container's lowest corner gives. Jets are faster: 1.1
# to 2.0 times that in 23 scenes of primitives, 2.4 in funnels, which squirt; a particle that a cone's map kicked 4.1.
SPEED_MARGIN = 3.0
REACH_SHARE = 0.999  # of a distance that a particle may move before it is measured again; less than 1 for rounding


class UnphysicalError(Exception):
    """What a simulation did that no fluid does; the message is one line."""


class Check:
    """Looks at the frames of one simulation in their order.

    Frames come as (3, N) float64, one row an axis, because sums along memory are ten times faster.
    """

    def __init__(self, scene: Scene, surface: Surface | None) -> None:
        """Prepare for a simulation of ``scene``, whose solid is ``surface``."""
        self._container = scene.container
        self._gravity = np.array(scene.gravity)
        self._solid = None if surface is None else SolidWatch(surface)
        self._frame = 0
        self._lowest_energy = math.inf
        self._fastest = math.inf

    def look_at(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Look at the next frame: positions (3, N) in metres and velocities (3, N) in m/s, float64.

        Raises:
            UnphysicalError: not finite, out of the container, in the solid, too fast, too dense, or energy was gained.
        """
        if not (np.isfinite(positions).all() and np.isfinite(velocities).all()):
            raise UnphysicalError("a position or velocity is not finite")
        lower, upper = self._container.lower, self._container.upper
        if (positions.min(axis=1) < lower).any() or (positions.max(axis=1) > upper).any():
            raise UnphysicalError("a particle left the container")
        if self._solid is not None:
            self._solid.look_at(positions)
        squared_speed = np.einsum("ij,ij->j", velocities, velocities)
        self._look_at_speed(positions, squared_speed)
        self._look_at_energy(positions, squared_speed)
        if self._frame % DENSITY_EVERY == 0:
            density = float(number_density(positions).max())
            if density > DENSITY_CEILING:
                raise UnphysicalError(f"the fluid was {density:.3g} times as dense as at rest, which it cannot be")
        self._frame += 1

    def _look_at_speed(self, positions: np.ndarray, squared_speed: np.ndarray) -> None:
        fastest = math.sqrt(squared_speed.max())
        if self._frame == 0:
            corners = np.stack([self._container.lower, self._container.upper], axis=1) * self._gravity[:, None]
            lowest = -corners.max(axis=1).sum()
            drop = float((-self._gravity @ positions).max() - lowest)
            self._fastest = SPEED_MARGIN * math.sqrt(fastest**2 + 2 * drop)
        elif fastest > self._fastest:
            raise UnphysicalError(f"a particle flew at {fastest:.3g} m/s, faster than any jet of such a fall")

    def _look_at_energy(self, positions: np.ndarray, squared_speed: np.ndarray) -> None:
        """The mean mechanical energy can only fall.

        Beyond the sharp tip of a cone a solver's map of it can have the wrong sign, far out in free space; a block that
        starts there bursts in the first frames.
        """
        energy = float(0.5 * squared_speed.mean() - self._gravity @ positions.mean(axis=1))
        self._lowest_energy = min(self._lowest_energy, energy)
        gained = energy - self._lowest_energy
        if gained > ENERGY_GAIN:
            raise UnphysicalError(f"the fluid gained {gained:.3g} J/kg, where it can only lose: it burst")


class SolidWatch:
    """Finds every particle that gets into a solid, but measures few distances.

    A particle at distance d is not inside before it has moved by d. So each is measured again only when it is as far
    from where it was measured last. Nothing is missed, and of 800 distances a particle some 20 are left.
    """

    def __init__(self, surface: Surface) -> None:
        """Watch ``surface``."""
        self._surface = surface
        self._measured_at: np.ndarray | None = None
        self._squared_reach = np.empty(0)

    def look_at(self, positions: np.ndarray) -> None:
        """Look at the next frame's positions (3, N), metres.

        Raises:
            UnphysicalError: a particle is inside.
        """
        if self._measured_at is None:
            self._measured_at = positions.copy()
            self._squared_reach = np.zeros(positions.shape[1])
        moved = positions - self._measured_at
        due = np.flatnonzero(np.einsum("ij,ij->j", moved, moved) >= self._squared_reach)
        if len(due) == 0:
            return
        with torch.no_grad():
            distance = self._surface.distance(torch.from_numpy(positions[:, due].T.astype(np.float32))).numpy()
        if (deepest := float(distance.min())) < 0:
            raise UnphysicalError(f"a particle was {-deepest:.3g} m inside the solid")
        self._measured_at[:, due] = positions[:, due]
        self._squared_reach[due] = (REACH_SHARE * distance.astype(np.float64)) ** 2
