"""Frame-by-frame comparison of trajectories with the reference trajectory of their scene."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from surfsup.evaluation.metrics import (
    UNDEFINED_CHAMFER,
    Chamfer,
    chamfer_surface,
    kd_tree,
    max_density,
    mean_chamfer,
    nearest_distances,
)
from surfsup.evaluation.near_surface import solids_for_metrics
from surfsup.evaluation.trajectory_statistics import StatisticsRecorder, TrajectoryStatistics, ValidParticles
from surfsup.io.trajectory import Trajectory
from surfsup.scene import NEAR_SURFACE_DISTANCE

FRAMES_PER_READ = 16  # bounds the memory
DENSITY_STRIDE = 10  # frames
THREADS = os.cpu_count() or 1


@dataclass(frozen=True)
class Comparison:
    """A predicted trajectory beside the reference; every array is (frames,).

    Attributes:
        prediction, reference: statistics of each by itself.
        chamfer: of plain distances, meters; NaN in a frame without valid particles in one of them.
        chamfer_squared: of squared distances, square meters.
        surface: Chamfer Surface of plain distances, meters, a sum over particles.
        surface_squared: Chamfer Surface of squared distances, square meters.
    """

    prediction: TrajectoryStatistics
    reference: TrajectoryStatistics
    chamfer: np.ndarray
    chamfer_squared: np.ndarray
    surface: np.ndarray
    surface_squared: np.ndarray

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.chamfer)

    def record_frame(
        self,
        number: int,
        prediction: ValidParticles,
        reference: ValidParticles,
        reference_tree: cKDTree,
        scale: float = 1.0,
    ) -> None:
        """Compare frame ``number``.

        Args:
            number: of the frame.
            prediction, reference: its particles.
            reference_tree: the search tree of the reference particles.
            scale: particle radius over 15 mm.
        """
        whole = near = UNDEFINED_CHAMFER
        if len(prediction.positions) and len(reference.positions):
            tree = kd_tree(prediction.positions)
            distances = nearest_distances(tree, reference_tree)
            whole, near = mean_chamfer(distances), chamfer_surface(distances, prediction.near, reference.near)
            if number % DENSITY_STRIDE == 0:
                self.prediction.density[number] = max_density(tree, scale)
        elif len(prediction.positions) == len(reference.positions):  # before water enters, or after all has left
            whole = near = Chamfer(0.0, 0.0)
        self.chamfer[number], self.chamfer_squared[number] = whole.plain, whole.squared
        self.surface[number], self.surface_squared[number] = near.plain, near.squared


def compare(
    reference: Trajectory,
    predictions: Sequence[Trajectory],
    threshold: float = NEAR_SURFACE_DISTANCE,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Comparison]:
    """Compare each of ``predictions`` with ``reference``, over the frames that all of them have.

    The reference is read, and its search trees are built, once for all predictions. Particle counts may differ.

    Args:
        reference: the trajectory of the reference solver.
        predictions: trajectories of the same scene.
        threshold: meters; closer particles count for Chamfer Surface.
        progress: called with the numbers of finished and of all frames.

    Raises:
        InputError: a mesh file of the scene is missing or not valid.
        OSError: a file is damaged.
    """
    frames = min(len(trajectory) for trajectory in (reference, *predictions))
    solids, scale = solids_for_metrics(reference), reference.scene.units.length
    recorders = [StatisticsRecorder(one, frames, solids, threshold) for one in (reference, *predictions)]
    reference_statistics = recorders[0].statistics
    comparisons = [
        Comparison(recorder.statistics, reference_statistics, *(np.full(frames, np.nan) for _ in range(4)))
        for recorder in recorders[1:]
    ]

    def record_frame(number: int, reference_frame: ValidParticles, *predicted_frames: ValidParticles) -> None:
        tree = kd_tree(reference_frame.positions)
        if number % DENSITY_STRIDE == 0 and tree.n:
            reference_statistics.density[number] = max_density(tree, scale)
        for comparison, predicted_frame in zip(comparisons, predicted_frames, strict=True):
            comparison.record_frame(number, predicted_frame, reference_frame, tree, scale)

    # The search trees release Python's lock, so threads help.
    with ThreadPoolExecutor(THREADS) as threads:
        for first in range(0, frames, FRAMES_PER_READ):
            last = min(first + FRAMES_PER_READ, frames)

            def read(recorder: StatisticsRecorder, first: int = first, last: int = last) -> list[ValidParticles]:
                trajectory = recorder.trajectory
                return recorder.record(trajectory.positions[first:last], trajectory.velocities[first:last], first)

            particles = list(threads.map(read, recorders))
            list(threads.map(record_frame, range(first, last), *particles))
            progress(last, frames)
    return comparisons
