"""Trajectories of one scene against its truth, frame by frame."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from surfsup.evaluation.metrics import NO_CHAMFER, chamfer_of, chamfer_surface, highest_density, nearest, tree
from surfsup.evaluation.near_surface import surface_for_metrics
from surfsup.evaluation.trajectory_statistics import Course, Frame, Observer
from surfsup.io.trajectory import Trajectory
from surfsup.scene import NEAR_SURFACE_DISTANCE

BLOCK = 16  # frames that are read at once; memory holds no more of a trajectory than that
DENSITY_EVERY = 10  # frames
THREADS = os.cpu_count() or 1


@dataclass(frozen=True)
class Comparison:
    """A trajectory beside the truth; every array is (frames,).

    Attributes:
        own, true: each by itself.
        chamfer: plain, meters; NaN in a frame that has no particle left.
        chamfer_squared: square meters.
        surface: Chamfer Surface of plain distances, meters, a sum over particles.
        surface_squared: of squared distances, square meters.
    """

    own: Course
    true: Course
    chamfer: np.ndarray
    chamfer_squared: np.ndarray
    surface: np.ndarray
    surface_squared: np.ndarray

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.chamfer)

    def take_down(self, number: int, own: Frame, true: Frame, truth: object) -> None:
        """Compare frame ``number``; ``truth`` is the search tree of the true particles."""
        whole = near = NO_CHAMFER
        if len(own.positions) and len(true.positions):
            particles = tree(own.positions)
            apart = nearest(particles, truth)
            whole, near = chamfer_of(apart), chamfer_surface(apart, own.near, true.near)
            if number % DENSITY_EVERY == 0:
                self.own.density[number] = highest_density(particles)
        self.chamfer[number], self.chamfer_squared[number] = whole.plain, whole.squared
        self.surface[number], self.surface_squared[number] = near.plain, near.squared


def compare(
    truth: Trajectory,
    others: Sequence[Trajectory],
    threshold: float = NEAR_SURFACE_DISTANCE,
    tell: Callable[[int, int], None] = lambda done, total: None,
) -> list[Comparison]:
    """Compare each of ``others`` with ``truth``, over the frames that all of them have.

    The truth is read and its search trees are built once for all. Particle counts may differ.

    Args:
        truth: what the reference solver made of the scene.
        others: trajectories of the same scene.
        threshold: meters; particles with a smaller distance count for Chamfer Surface.
        tell: told how many frames are done.

    Raises:
        InputError: a mesh file of the scene is missing or not usable.
        OSError: a file is damaged.
    """
    frames = min(len(trajectory) for trajectory in (truth, *others))
    surface = surface_for_metrics(truth.scene)
    observers = [Observer(trajectory, frames, surface, threshold) for trajectory in (truth, *others)]
    true = observers[0].course
    comparisons = [
        Comparison(observer.course, true, *(np.full(frames, np.nan) for _ in range(4))) for observer in observers[1:]
    ]

    def take_down(number: int, true_frame: Frame, *own_frames: Frame) -> None:
        particles = tree(true_frame.positions)
        if number % DENSITY_EVERY == 0 and particles.n:
            true.density[number] = highest_density(particles)
        for comparison, own_frame in zip(comparisons, own_frames, strict=True):
            comparison.take_down(number, own_frame, true_frame, particles)

    # The search trees work outside Python's lock, so that threads help.
    with ThreadPoolExecutor(THREADS) as threads:
        for first in range(0, frames, BLOCK):
            last = min(first + BLOCK, frames)

            def read(observer: Observer, first: int = first, last: int = last) -> list[Frame]:
                positions = observer.trajectory.positions[first:last]
                return observer.observe(positions, observer.trajectory.velocities[first:last], first)

            seen = list(threads.map(read, observers))
            list(threads.map(take_down, range(first, last), *seen))
            tell(last, frames)
    return comparisons
