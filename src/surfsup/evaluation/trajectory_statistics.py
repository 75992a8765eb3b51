"""What a trajectory is like by itself, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surfsup.datasets.check import FASTEST
from surfsup.evaluation.metrics import center_height, inside_container, kinetic_energy
from surfsup.evaluation.near_surface import NearSurface
from surfsup.io.trajectory import Trajectory
from surfsup.sdf import Surface


@dataclass(frozen=True)
class Course:
    """One trajectory by itself; every array is (frames,).

    Attributes:
        height: of the center of mass, meters.
        energy: kinetic, J/kg.
        inside: particles in the solid.
        depth: sum of the (negative) distances of those, meters.
        near: particles nearer to the solid than the threshold.
        lost: particles out of the container, no longer numbers, or faster than any simulation can follow.
        density: highest, over that of the lattice at rest; NaN in frames where it was not taken.
    """

    height: np.ndarray
    energy: np.ndarray
    inside: np.ndarray
    depth: np.ndarray
    near: np.ndarray
    lost: np.ndarray
    density: np.ndarray

    @classmethod
    def unknown(cls, frames: int) -> Course:
        """A course of that many frames, nothing of which has been seen yet."""
        return cls(*(np.full(frames, np.nan) for _ in cls.__dataclass_fields__))


@dataclass(frozen=True)
class Frame:
    """What of a frame is compared.

    Attributes:
        positions: (N, 3) of those particles that are finite and no faster than FASTEST, meters.
        near: (N,) which of these are near the surface.
    """

    positions: np.ndarray
    near: np.ndarray


class Observer:
    """Reads a trajectory from its first frame to its last and takes down its course.

    Args:
        trajectory: what to read.
        frames: how many of its frames.
        surface: the scene's solid, or None.
        threshold: meters; nearer particles are near the surface.
    """

    def __init__(self, trajectory: Trajectory, frames: int, surface: Surface | None, threshold: float) -> None:
        self.trajectory = trajectory
        self.course = Course.unknown(frames)
        self.near_surface = NearSurface(surface, threshold)
        container = trajectory.scene.container
        self.lower, self.upper = np.float32(container.lower), np.float32(container.upper)

    def observe(self, positions: np.ndarray, velocities: np.ndarray, first: int) -> list[Frame]:
        """Take down the frames from number ``first`` on, of (F, N, 3) each, and hand them on for comparing."""
        frames = enumerate(zip(positions, velocities, strict=True), start=first)
        return [self.observe_frame(*frame, number) for number, frame in frames]

    def observe_frame(self, positions: np.ndarray, velocities: np.ndarray, number: int) -> Frame:
        """Take down frame ``number``: positions and velocities (N, 3)."""
        course, contact = self.course, self.near_surface.look(positions)
        course.inside[number] = len(contact.depths)
        course.depth[number] = contact.depths.sum()
        course.near[number] = contact.near.sum()
        # A comparison with NaN is false, so what is no number is not sane either.
        sane = np.isfinite(positions).all(axis=1) & (np.square(velocities).sum(axis=1) <= FASTEST**2)
        there = inside_container(positions, self.lower, self.upper) & sane
        course.lost[number] = len(positions) - there.sum()
        if sane.any():
            course.height[number] = center_height(positions[sane])
            course.energy[number] = kinetic_energy(velocities[sane])
        return Frame(positions[sane], contact.near[sane])
