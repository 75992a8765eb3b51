"""Statistics of one trajectory by itself, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surfsup.datasets.generation.physical_check import MAX_SPEED
from surfsup.evaluation.metrics import center_height, inside_container, kinetic_energy
from surfsup.evaluation.near_surface import Contact, ContactTracker
from surfsup.io.trajectory import Trajectory
from surfsup.scene.pose import Pose
from surfsup.scene.solids import CONTAINER, Solids


@dataclass(frozen=True)
class TrajectoryStatistics:
    """Statistics of one trajectory; every array is (frames,).

    Attributes:
        height: of the center of mass, meters; 0 where no water is in the scene.
        energy: kinetic, J/kg; 0 where no water is in the scene.
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
        solids: of the scene; those that move are where the trajectory, or else its scene, has them.
        threshold: meters; a closer particle is near the surface.
    """

    def __init__(self, trajectory: Trajectory, frames: int, solids: Solids, threshold: float) -> None:
        self.trajectory = trajectory
        self.statistics = TrajectoryStatistics.undefined(frames)
        self.contacts = ContactTracker(solids.still, threshold)
        self.moving = [(solid.name, ContactTracker(solid.surface, threshold)) for solid in solids.moving]
        self.poses = [self._poses(solids, number) for number in range(frames if solids.move else 0)]
        self.max_speed = MAX_SPEED * trajectory.scene.units.velocity
        container = trajectory.scene.container
        self.lower, self.upper = (np.array(corner, np.float32) for corner in (container.lower, container.upper))

    def record(self, positions: np.ndarray, velocities: np.ndarray, first: int) -> list[ValidParticles]:
        """Record the frames from number ``first`` on, (F, N, 3) each, and return their valid particles."""
        frames = enumerate(zip(positions, velocities, strict=True), start=first)
        return [self.record_frame(*frame, number) for number, frame in frames]

    def record_frame(self, positions: np.ndarray, velocities: np.ndarray, number: int) -> ValidParticles:
        """Record frame ``number``: positions and velocities (N, 3)."""
        statistics, contact = self.statistics, self._classify(positions, number)
        statistics.inside[number] = len(contact.depths)
        statistics.depth[number] = contact.depths.sum()
        statistics.near[number] = contact.near.sum()
        # A comparison with NaN is false, so a particle with a NaN velocity is not valid either.
        valid = np.isfinite(positions).all(axis=1) & (np.square(velocities).sum(axis=1) <= self.max_speed**2)
        shaken = self.poses[number].get(CONTAINER) if self.poses else None
        own = positions if shaken is None else shaken.to_own(positions)
        contained = inside_container(own, self.lower, self.upper) & valid
        count = len(self.trajectory.ids(number))
        statistics.lost[number] = count - contained.sum()
        if count == 0:  # before water enters, or after all has left
            statistics.height[number] = statistics.energy[number] = 0.0
        if valid.any():
            statistics.height[number] = center_height(positions[valid])
            statistics.energy[number] = kinetic_energy(velocities[valid])
        return ValidParticles(positions[valid], contact.near[valid])

    def _poses(self, solids: Solids, number: int) -> dict[str, Pose]:
        """Where everything that moves is in a frame."""
        written = self.trajectory.poses
        time = self.trajectory.start_time + number * self.trajectory.frame_time
        described = {} if written else solids.poses(time)
        return {**described, **{name: Pose.from_array(rows[number]) for name, rows in written.items()}}

    def _classify(self, positions: np.ndarray, number: int) -> Contact:
        """The contact of a frame with all solids; a particle inside two of them counts in both."""
        contacts = [self.contacts.classify(positions)]
        for name, tracker in self.moving:
            own = self.poses[number][name].to_own(positions).astype(np.float32)
            contacts.append(tracker.classify(own))
        if len(contacts) == 1:
            return contacts[0]
        near = np.any([contact.near for contact in contacts], axis=0)
        return Contact(near, np.concatenate([contact.depths for contact in contacts]))
