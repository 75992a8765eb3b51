"""The particles of a trajectory at any rate of frames, one frame after the other."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch

from surfsup.scene.units import Units
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.environment import Environment
from surfsup.sph.interpolation import ROUNDING, hermite
from surfsup.sph.state import ParticleState


@dataclass(frozen=True)
class ParticleFrame:
    """The particles at one time. Their number may differ from frame to frame.

    Attributes:
        time: seconds since the start of the scene.
        positions: (N, 3) float32, meters.
        velocities: (N, 3) float32, m/s.
        ids: (N,) int32, ascending; a particle keeps its id over all frames.
        radius: of a particle, meters.
        liquids: (N,) int32, number of each particle's liquid; None in a scene of one.
    """

    time: float
    positions: np.ndarray
    velocities: np.ndarray
    ids: np.ndarray
    radius: float
    liquids: np.ndarray | None = None


Between = Callable[[ParticleFrame, ParticleFrame, float], ParticleFrame]  # the last value is the time


def frame_count(frames: int, frame_time: float, fps: float) -> int:
    """Number of frames at ``fps`` frames a second within ``frames`` frames that are ``frame_time`` seconds apart."""
    return math.floor((frames - 1) * frame_time * fps + ROUNDING) + 1 if frames else 0


def resample(
    frames: Iterable[ParticleFrame], frame_time: float, fps: float, between: Between
) -> Iterator[ParticleFrame]:
    """Frames at ``fps`` a second, from the first of ``frames`` to the last.

    Args:
        frames: ``frame_time`` seconds apart; two are kept in memory at a time.
        frame_time: seconds.
        fps: frames per second.
        between: makes the frame at a time between two.
    """
    source = enumerate(frames)
    first = next(source, None)
    if first is None:
        return
    number, new = first
    old, start = new, new.time
    for index in range(1 << 62):
        target = index / (fps * frame_time)  # in frames of the source
        while number < target - ROUNDING:
            following = next(source, None)
            if following is None:
                return
            old, (number, new) = new, following
        whole = number - target < ROUNDING
        time = start + index / fps
        yield replace(new, time=time) if whole else between(old, new, time)


def common_particles(old: ParticleFrame, new: ParticleFrame) -> tuple[ParticleFrame, ParticleFrame]:
    """Both frames with only those particles that are in both."""
    if np.array_equal(old.ids, new.ids):
        return old, new
    _, *rows = np.intersect1d(old.ids, new.ids, assume_unique=True, return_indices=True)
    return selected(old, rows[0]), selected(new, rows[1])


def selected(frame: ParticleFrame, rows: np.ndarray) -> ParticleFrame:
    """The frame with the particles of ``rows`` alone."""
    parts = (frame.positions, frame.velocities, frame.ids)
    positions, velocities, ids = (values[rows] for values in parts)
    liquids = None if frame.liquids is None else frame.liquids[rows]
    return replace(frame, positions=positions, velocities=velocities, ids=ids, liquids=liquids)


@dataclass(frozen=True)
class Interpolation:
    """Cubic Hermite splines through positions and velocities, with collision handling.

    A particle that a spline takes into the solid or out of the container is moved out again, unless the trajectory
    itself has it there.

    Attributes:
        environment_at: solid and container at a time, in the units of the solver.
        units: of the trajectory.
        frame_time: seconds between the frames of the trajectory.
    """

    environment_at: Callable[[float], Environment]
    units: Units
    frame_time: float

    @torch.no_grad()
    def __call__(self, old: ParticleFrame, new: ParticleFrame, time: float) -> ParticleFrame:
        """The frame at ``time`` between two frames: the particles that are in both."""
        old, new = common_particles(old, new)
        before, after = self._as_state(old), self._as_state(new)
        part = 1 - (new.time - time) / self.frame_time
        first, last = ((state.positions, state.velocities) for state in (before, after))
        positions, velocities = hermite(first, last, part, self.frame_time / self.units.time)
        environment = self.environment_at(time)
        result = resolve_collisions(before.positions, positions, velocities, environment)
        moved = result.collided.nonzero()[:, 0]
        ends = (
            collided(before, moved, self.environment_at(old.time)),
            collided(after, moved, self.environment_at(new.time)),
        )
        kept = moved[ends[0] | ends[1]]
        result.positions[kept], result.velocities[kept] = positions[kept], velocities[kept]
        place, speed = self.units.frame_from_solver(result.positions.numpy(), result.velocities.numpy())
        return replace(new, time=time, positions=place, velocities=speed)

    def _as_state(self, frame: ParticleFrame) -> ParticleState:
        """The particles in the units of the solver."""
        positions, velocities = self.units.frame_to_solver(frame.positions, frame.velocities)
        return ParticleState(torch.from_numpy(positions), torch.from_numpy(velocities))


def collided(state: ParticleState, rows: torch.Tensor, environment: Environment) -> torch.Tensor:
    """Which particles (K,) of ``rows`` (K,) collision handling would move."""
    positions, velocities = state.positions[rows], state.velocities[rows]
    return resolve_collisions(positions, positions, velocities, environment).collided
