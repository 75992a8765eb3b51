"""Statistics of one trajectory by itself, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surfsup.datasets.generation.physical_check import MAX_SPEED
from surfsup.evaluation.metrics import center_height, inside_container, kinetic_energy
from surfsup.evaluation.near_surface import ContactTracker
from surfsup.io.trajectory import Trajectory
from surfsup.sdf import Surface


@dataclass(frozen=True)
class TrajectoryStatistics:
    """Statistics of one trajectory; every array is (frames,).

    Attributes:
        height: of the center of mass, meters.
        energy: kinetic, J/kg.
        inside: number of particles inside the solid.
        depth: sum of the (negative) signed distances of these particles, meters.
        near: number of particles closer to the solid than the threshold.
        lost: number of particles outside the container, not finite, or faster than the reference solver can resolve.
        density: maximum, relative to that of the lattice at rest; NaN in frames where it was not computed.
    """

    height: np.ndarray
    energy: np.ndarray
    inside: np.ndarray
    depth: np.ndarray
    near: np.ndarray
    lost: np.ndarray
    density: np.ndarray

    @classmethod
    def undefined(cls, frames: int) -> TrajectoryStatistics:
        """Statistics of that many frames, all NaN."""
        return cls(*(np.full(frames, np.nan) for _ in cls.__dataclass_fields__))


@dataclass(frozen=True)
class ValidParticles:
    """The particles of a frame that metrics compare: finite and no faster than MAX_SPEED, with particles of 15 mm.

    Attributes:
        positions: (N, 3), meters.
        near: (N,) whether a particle is near the surface.
    """

    positions: np.ndarray
    near: np.ndarray


class StatisticsRecorder:
    """Computes the statistics of a trajectory while it is read from its first frame to its last.

    Args:
        trajectory: the trajectory.
        frames: number of frames to read.
        surface: the scene's solid, or None.
        threshold: meters; a closer particle is near the surface.
    """

    def __init__(self, trajectory: Trajectory, frames: int, surface: Surface | None, threshold: float) -> None:
        self.trajectory = trajectory
        self.statistics = TrajectoryStatistics.undefined(frames)
        self.contacts = ContactTracker(surface, threshold)
        self.max_speed = MAX_SPEED * trajectory.scene.units.velocity
        container = trajectory.scene.container
        self.lower, self.upper = (np.array(corner, np.float32) for corner in (container.lower, container.upper))

    def record(self, positions: np.ndarray, velocities: np.ndarray, first: int) -> list[ValidParticles]:
        """Record the frames from number ``first`` on, (F, N, 3) each, and return their valid particles."""
        frames = enumerate(zip(positions, velocities, strict=True), start=first)
        return [self.record_frame(*frame, number) for number, frame in frames]

    def record_frame(self, positions: np.ndarray, velocities: np.ndarray, number: int) -> ValidParticles:
        """Record frame ``number``: positions and velocities (N, 3)."""
        statistics, contact = self.statistics, self.contacts.classify(positions)
        statistics.inside[number] = len(contact.depths)
        statistics.depth[number] = contact.depths.sum()
        statistics.near[number] = contact.near.sum()
        # A comparison with NaN is false, so a particle with a NaN velocity is not valid either.
        valid = np.isfinite(positions).all(axis=1) & (np.square(velocities).sum(axis=1) <= self.max_speed**2)
        contained = inside_container(positions, self.lower, self.upper) & valid
        statistics.lost[number] = len(positions) - contained.sum()
        if valid.any():
            statistics.height[number] = center_height(positions[valid])
            statistics.energy[number] = kinetic_energy(velocities[valid])
        return ValidParticles(positions[valid], contact.near[valid])
