"""The particles of a trajectory at any rate of frames, one frame after the other."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch

from surfsup.simulation import ROUNDING, hermite
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.environment import Environment
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
    """

    time: float
    positions: np.ndarray
    velocities: np.ndarray
    ids: np.ndarray
    radius: float


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
    return replace(frame, positions=positions, velocities=velocities, ids=ids)


@dataclass(frozen=True)
class Interpolation:
    """Cubic Hermite splines through positions and velocities, with collision handling.

    A particle that a spline takes into the solid or out of the container is moved out again, unless the trajectory
    itself has it there.

    Attributes:
        environment: solid and container.
        frame_time: seconds between the frames of the trajectory.
    """

    environment: Environment
    frame_time: float

    @torch.no_grad()
    def __call__(self, old: ParticleFrame, new: ParticleFrame, time: float) -> ParticleFrame:
        """The frame at ``time`` between two frames: the particles that are in both."""
        old, new = common_particles(old, new)
        before, after = as_state(old), as_state(new)
        part = 1 - (new.time - time) / self.frame_time
        positions, velocities = hermite(before, after, part, self.frame_time)
        result = resolve_collisions(before.positions, positions, velocities, self.environment)
        moved = result.collided.nonzero()[:, 0]
        kept = moved[self._collided(before, moved) | self._collided(after, moved)]
        result.positions[kept], result.velocities[kept] = positions[kept], velocities[kept]
        return replace(new, time=time, positions=result.positions.numpy(), velocities=result.velocities.numpy())

    def _collided(self, state: ParticleState, rows: torch.Tensor) -> torch.Tensor:
        """Which particles (K,) of ``rows`` (K,) collision handling would move."""
        positions, velocities = state.positions[rows], state.velocities[rows]
        return resolve_collisions(positions, positions, velocities, self.environment).collided


def as_state(frame: ParticleFrame) -> ParticleState:
    """The particles as tensors, without a copy."""
    return ParticleState(torch.from_numpy(frame.positions), torch.from_numpy(frame.velocities))
