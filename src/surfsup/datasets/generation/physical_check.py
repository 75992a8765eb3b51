"""Whether a simulation is physical, asked frame by frame while it runs."""

from __future__ import annotations

import math

import numpy as np
import torch

from surfsup.datasets.density import number_density
from surfsup.scene import SPACING, Scene
from surfsup.sdf import Surface
from surfsup.splishsplash.job_files import SOLVER_STEP

# Of 87 scenes 81 gained at most 0.02 J/kg; those that a wrong boundary kicked gained 0.11 to 2.8.
ENERGY_GAIN = 0.05
# The solver keeps water from being compressed: in 24 scenes, every tenth frame, the densest particle had 1.008 times
# the lattice's number density, and 38 neighbors within 0.06 m instead of 32.
DENSITY_CEILING = 1.05
DENSITY_EVERY = 25  # frames: looking takes 2 ms, and what clumps stays clumped
# m/s: a particle that passes its neighbors within one step of the solver has not been simulated. Jets are slower: 11
# from primitives, 14 to 18 below funnels, 26 from the hole of a bowl; a dozen particles each, and no energy is gained.
FASTEST = SPACING / SOLVER_STEP
REACH_SHARE = 0.999  # of a distance that a particle may move before it is measured again; less than 1 for rounding


class UnphysicalError(Exception):
    """What a simulation did that no fluid does; the message is one line."""


class Check:
    """Looks at the frames of one simulation in their order, some at a time.

    Frames come as (K, 3, N) float64, one row an axis, because sums along memory are ten times faster.
    """

    def __init__(self, scene: Scene, surface: Surface | None) -> None:
        """Prepare for a simulation of ``scene``, whose solid is ``surface``."""
        self._lower, self._upper = (np.array(corner) for corner in (scene.container.lower, scene.container.upper))
        self._gravity = np.array(scene.gravity)
        self._solid = None if surface is None else SolidWatch(surface)
        self._frames = 0
        self._lowest_energy = math.inf

    def look_at(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Look at the next frames: positions (K, 3, N) in meters and velocities (K, 3, N) in m/s, float64.

        Raises:
            UnphysicalError: not finite, out of the container, in the solid, too fast, too dense, or energy was gained.
        """
        if not (np.isfinite(positions).all() and np.isfinite(velocities).all()):
            raise UnphysicalError("a position or velocity is not finite")
        if (positions.min(axis=2) < self._lower).any() or (positions.max(axis=2) > self._upper).any():
            raise UnphysicalError("a particle left the container")
        if self._solid is not None:
            self._solid.look_at(positions)
        squared_speed = np.einsum("kij,kij->kj", velocities, velocities)
        fastest = math.sqrt(squared_speed.max())
        if fastest > FASTEST:
            raise UnphysicalError(f"a particle flew at {fastest:.3g} m/s, past its neighbors in a step of the solver")
        self._look_at_energy(positions, squared_speed)
        for frame in range(-self._frames % DENSITY_EVERY, len(positions), DENSITY_EVERY):
            density = float(number_density(positions[frame]).max())
            if density > DENSITY_CEILING:
                raise UnphysicalError(f"the fluid was {density:.3g} times as dense as at rest, which it cannot be")
        self._frames += len(positions)

    def _look_at_energy(self, positions: np.ndarray, squared_speed: np.ndarray) -> None:
        """The mean mechanical energy can only fall.

        Beyond the sharp tip of a cone a solver's map of it can have the wrong sign, far out in free space; a block that
        starts there bursts in the first frames.
        """
        energies = 0.5 * squared_speed.mean(axis=1) - positions.mean(axis=2) @ self._gravity
        lowest = np.minimum.accumulate(np.minimum(energies, self._lowest_energy))
        gained = float((energies - lowest).max())
        if gained > ENERGY_GAIN:
            raise UnphysicalError(f"the fluid gained {gained:.3g} J/kg, where it can only lose: it burst")
        self._lowest_energy = lowest[-1]


class SolidWatch:
    """Finds every particle that gets into a solid, but measures few distances.

    A particle at distance d is not inside before it has moved by d. So each is measured again only when it is as far
    from where it was measured last. Nothing is missed, and of 800 distances a particle some 20 are left.
    """

    def __init__(self, surface: Surface) -> None:
        """Watch ``surface``."""
        self._surface = surface
        self._measured_at: np.ndarray | None = None  # (3, N)
        self._squared_reach = np.empty(0)  # (N,)

    def look_at(self, positions: np.ndarray) -> None:
        """Look at the positions (K, 3, N) of the next frames, meters.

        Raises:
            UnphysicalError: a particle is inside.
        """
        frames, _, count = positions.shape
        if self._measured_at is None:
            self._measured_at, self._squared_reach = positions[0].copy(), np.zeros(count)
            self._measure(positions[0], np.arange(count))
        watched, since = np.arange(count), np.full(count, -1)
        seen, measured_at = positions, self._measured_at
        while len(watched):
            moved = seen - measured_at
            due = np.einsum("kij,kij->kj", moved, moved) >= self._squared_reach[watched]
            due &= np.arange(frames)[:, None] > since
            # Each is measured at the first frame at which it is due, and from there watched on.
            some = due.any(axis=0)
            watched, since = watched[some], due[:, some].argmax(axis=0)
            self._measure(positions[since, :, watched].T, watched)
            seen, measured_at = positions[:, :, watched], self._measured_at[:, watched]

    def _measure(self, positions: np.ndarray, particles: np.ndarray) -> None:
        """Measure the distances of ``particles`` (M,), which are at ``positions`` (3, M)."""
        if len(particles) == 0:
            return
        with torch.no_grad():
            distance = self._surface.distance(torch.from_numpy(positions.T.astype(np.float32))).numpy()
        if (deepest := float(distance.min())) < 0:
            raise UnphysicalError(f"a particle was {-deepest:.3g} m inside the solid")
        self._measured_at[:, particles] = positions
        self._squared_reach[particles] = (REACH_SHARE * distance.astype(np.float64)) ** 2
