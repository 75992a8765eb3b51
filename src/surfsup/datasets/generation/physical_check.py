"""Checks the frames of a simulation while it runs: is the result physical?"""

from __future__ import annotations

import math

import numpy as np
import torch

from surfsup.datasets.density import number_density
from surfsup.scene import FRAME_TIME, SPACING, Scene
from surfsup.scene.solids import Solids
from surfsup.sdf import Surface
from surfsup.sph.state import SUBSTEP_TIME

# J/kg. Of 87 scenes 81 gained at most 0.02; scenes with a wrong boundary map gained 0.11 to 2.8.
MAX_ENERGY_GAIN = 0.05
# The solver keeps the fluid from being compressed: in 24 scenes, every tenth frame, the densest particle had 1.008
# times the lattice's number density, and 38 neighbors within 0.06 m instead of 32.
MAX_DENSITY = 1.05
DENSITY_INTERVAL = 25  # frames; a density check takes 2 ms, and particles that clump stay clumped
# m/s: above this speed a particle passes its neighbors within one substep of the solver. Jets are slower: 11 from
# primitives, 14 to 18 below funnels, 26 from the hole of a bowl; they have a dozen particles and gain no energy.
MAX_SPEED = SPACING / SUBSTEP_TIME
REACH_FACTOR = 0.999  # share of its distance that a particle may move before the next query; below 1 for rounding


class UnphysicalError(Exception):
    """A simulation did what no fluid does. The message is one line."""


class PhysicalCheck:
    """Checks the frames of one simulation in their order, several at a time.

    Frames are (K, 3, N) float64, one row for each axis, because sums along memory are ten times faster. They are in the
    units of the simulators (:class:`surfsup.scene.Units`). Where water enters or leaves, particles that are not in the
    scene have NaN.
    """

    def __init__(self, scene: Scene, solids: Solids) -> None:
        """Prepare for a simulation of ``scene`` with ``solids``."""
        solids = scene.units.solids_to_solver(solids)
        container = scene.units.scene_to_solver(scene).container
        self._lower, self._upper = (np.array(corner) for corner in (container.lower, container.upper))
        self._gravity = np.array(scene.gravity)
        self._penetration = None if solids.still is None else PenetrationCheck(solids.still)
        self._solids = solids
        self._open = scene.is_open
        self._frames = 0
        self._lowest_energy = math.inf

    def check(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Check the next frames: positions (K, 3, N) in meters and velocities (K, 3, N) in m/s, float64.

        Raises:
            UnphysicalError: a value is not finite, or a particle is outside the container, inside the solid or too
                fast, or the fluid is too dense or gained energy.
        """
        if not self._open:
            self._check(positions, velocities)
            return
        for place, velocity in zip(positions, velocities, strict=True):
            there = np.isfinite(place).all(axis=0)  # the solver refuses NaN of particles that are in the scene
            if there.any():
                self._check(place[:, there][None], velocity[:, there][None])
            else:
                self._frames += 1

    def _check(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Check the next frames with the particles that are in the scene."""
        if not (np.isfinite(positions).all() and np.isfinite(velocities).all()):
            raise UnphysicalError("a position or velocity is not finite")
        self._check_container(positions)
        if self._penetration is not None and self._open:
            for frame in positions:
                check_outside(self._penetration.surface, frame.T)
        elif self._penetration is not None:
            self._penetration.check(positions)
        self._check_moving(positions)
        squared_speed = np.einsum("kij,kij->kj", velocities, velocities)
        speed = math.sqrt(squared_speed.max())
        if speed > MAX_SPEED:
            raise UnphysicalError(f"a particle flew at {speed:.3g} m/s, past its neighbors in a step of the solver")
        if not (self._solids.move or self._open):  # what moves does work on the fluid, and taps bring energy
            self._check_energy(positions, squared_speed)
        for frame in range(-self._frames % DENSITY_INTERVAL, len(positions), DENSITY_INTERVAL):
            density = float(number_density(positions[frame]).max())
            if density > MAX_DENSITY:
                raise UnphysicalError(f"the fluid was {density:.3g} times as dense as at rest, which it cannot be")
        self._frames += len(positions)

    def _check_container(self, positions: np.ndarray) -> None:
        """Check that no particle is outside the container, which may move."""
        if self._solids.container is not None:
            poses = [self._solids.container((self._frames + k) * FRAME_TIME) for k in range(len(positions))]
            positions = np.stack([pose.to_own(frame.T).T for pose, frame in zip(poses, positions, strict=True)])
        if (positions.min(axis=2) < self._lower).any() or (positions.max(axis=2) > self._upper).any():
            raise UnphysicalError("a particle left the container")

    def _check_moving(self, positions: np.ndarray) -> None:
        """Check that no particle is inside a solid that moves."""
        for solid in self._solids.moving:
            for number, frame in enumerate(positions, start=self._frames):
                own = solid.pose(number * FRAME_TIME).to_own(frame.T)
                check_outside(solid.surface, own)

    def _check_energy(self, positions: np.ndarray, squared_speed: np.ndarray) -> None:
        """Check that the mean mechanical energy only falls.

        The solver's map of a cone can have the wrong sign beyond the sharp tip, far out in free space. A block that
        starts there bursts in the first frames.
        """
        energies = 0.5 * squared_speed.mean(axis=1) - positions.mean(axis=2) @ self._gravity
        lowest = np.minimum.accumulate(np.minimum(energies, self._lowest_energy))
        gain = float((energies - lowest).max())
        if gain > MAX_ENERGY_GAIN:
            raise UnphysicalError(f"the fluid gained {gain:.3g} J/kg, where it can only lose: it burst")
        self._lowest_energy = lowest[-1]


class PenetrationCheck:
    """Finds every particle that enters a solid, with few distance queries.

    A particle at distance d cannot be inside before it has moved by d. Each particle is queried again only after it has
    moved that far from its last query. Nothing is missed, and 800 frames need about 20 queries per particle.
    """

    def __init__(self, surface: Surface) -> None:
        """Prepare for a simulation with the solid ``surface``."""
        self.surface = surface
        self._queried_at = np.empty((3, 0))  # (3, N) positions of the last queries
        self._squared_reach = np.empty(0)  # (N,)

    def check(self, positions: np.ndarray) -> None:
        """Check the positions (K, 3, N) of the next frames, meters.

        Raises:
            UnphysicalError: a particle is inside the solid.
        """
        frames, _, count = positions.shape
        if len(self._squared_reach) == 0:
            self._queried_at, self._squared_reach = positions[0].copy(), np.zeros(count)
            self._query(positions[0], np.arange(count))
        particles, last = np.arange(count), np.full(count, -1)
        moving, queried_at = positions, self._queried_at
        while len(particles):
            moved = moving - queried_at
            due = np.einsum("kij,kij->kj", moved, moved) >= self._squared_reach[particles]
            due &= np.arange(frames)[:, None] > last
            # Query each particle at its first due frame, then follow it from there.
            some = due.any(axis=0)
            particles, last = particles[some], due[:, some].argmax(axis=0)
            self._query(positions[last, :, particles].T, particles)
            moving, queried_at = positions[:, :, particles], self._queried_at[:, particles]

    def _query(self, positions: np.ndarray, particles: np.ndarray) -> None:
        """Query the distances of ``particles`` (M,) at ``positions`` (3, M)."""
        if len(particles) == 0:
            return
        distance = check_outside(self.surface, positions.T)
        self._queried_at[:, particles] = positions
        self._squared_reach[particles] = (REACH_FACTOR * distance.astype(np.float64)) ** 2


def check_outside(surface: Surface, points: np.ndarray) -> np.ndarray:
    """The distances (M,) of ``points`` (M, 3) to a solid, in its frame.

    Raises:
        UnphysicalError: a point is inside.
    """
    with torch.no_grad():
        distance = surface.distance(torch.from_numpy(points.astype(np.float32))).numpy()
    if (deepest := float(distance.min())) < 0:
        raise UnphysicalError(f"a particle was {-deepest:.3g} m inside the solid")
    return distance
