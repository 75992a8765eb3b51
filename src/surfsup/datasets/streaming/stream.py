"""An endless stream of simulations, each delivered when it is finished while the workers continue."""

from __future__ import annotations

import os
import queue
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup.datasets.folder import LOCK, lock_folder
from surfsup.datasets.generation.checked_simulation import CheckedSimulation, simulate_valid_scene
from surfsup.datasets.generation.scene_sampler import SceneSampler
from surfsup.datasets.generation.worker_pool import WorkerPool, open_worker_pool, until_canceled
from surfsup.errors import InputError
from surfsup.scene import Scene

SURFACE_COUNT = 100  # surfaces that a recipe keeps in files; the scenes take them one after the other


@dataclass(frozen=True)
class SimulatedScene:
    """A finished simulation in memory.

    Attributes:
        index: of the scene in the stream.
        scene: the scene.
        positions: (frames, N, 3) float32, meters.
        velocities: (frames, N, 3) float32 in m/s, at the end of each frame.
    """

    index: int
    scene: Scene
    positions: np.ndarray
    velocities: np.ndarray

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.positions)

    def window(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (count, N, 3) of ``count`` frames from ``first`` on."""
        return self.positions[first : first + count], self.velocities[first : first + count]


class SimulationStream:
    """An endless iterator over simulations, in the order in which they finish. No scene occurs twice.

    At most ``max_pending`` simulations run or wait at a time, which bounds the memory. Taking one starts the next.
    """

    def __init__(self, sampler: SceneSampler, pool: WorkerPool, max_pending: int) -> None:
        """Start the first ``max_pending`` simulations."""
        self._sampler, self._pool = sampler, pool
        self._done: queue.SimpleQueue[Future[SimulatedScene]] = queue.SimpleQueue()
        self._index = 0
        for _ in range(max_pending):
            self._start_next()

    def _start_next(self) -> None:
        self._pool.submit(simulate_in_memory, self._sampler, self._index).add_done_callback(self._done.put)
        self._index += 1

    def __iter__(self) -> Iterator[SimulatedScene]:
        """The stream itself."""
        return self

    def __next__(self) -> SimulatedScene:
        """Wait for the next finished simulation.

        Raises:
            SimulationError: no valid scene was found for an index, or the scheduler was lost.
        """
        return self._take(self._pool.wait_for(self._done))

    def finished(self) -> list[SimulatedScene]:
        """All finished simulations, without waiting.

        Raises:
            SimulationError: as for the iterator.
        """
        simulations = []
        with suppress(queue.Empty):
            while True:
                simulations.append(self._take(self._done.get_nowait()))
        return simulations

    def _take(self, done: Future[SimulatedScene]) -> SimulatedScene:
        simulated = done.result()
        self._start_next()
        return simulated


@contextmanager
def open_stream(
    recipe: str,
    folder: Path,
    seed: int = 0,
    frames: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    max_pending: int | None = None,
) -> Iterator[SimulationStream]:
    """An endless stream of simulations of ``recipe``. The workers stop at the end of the context.

    Args:
        recipe: name of the recipe.
        folder: for the recipe's surface files. All workers must share it under this path if there are any; the
            simulations themselves return through the scheduler.
        seed: determines each scene, together with the scene's index.
        frames: number of frames of every scene; the recipe's own by default.
        workers: simulations side by side on this machine, each on one core; 2 by default.
        scheduler: address of a dask scheduler to use instead.
        max_pending: limit of simulations that run or wait; by default twice the number that run side by side.

    Raises:
        InputError: the recipe does not exist, ``max_pending`` is below 1, or the workers cannot do the work.
    """
    if max_pending is not None and max_pending < 1:
        raise InputError(f"max_pending is {max_pending}, but must be at least 1")
    folder = folder.resolve()
    sampler = SceneSampler(recipe, seed, frames, folder)
    with open_worker_pool(workers, scheduler) as pool, lock_folder(folder) as token:
        sampler.prepare(None, SURFACE_COUNT)
        has_files = os.listdir(folder) != [LOCK]
        pool.check_workers(folder if has_files else None, token)
        yield SimulationStream(sampler, pool, max_pending or 2 * pool.slots)


def simulate_in_memory(sampler: SceneSampler, index: int) -> SimulatedScene:
    """Simulate scene ``index``."""

    def collect(simulation: CheckedSimulation) -> SimulatedScene:
        shape = (simulation.scene.frames, simulation.particles, 3)
        positions, velocities = np.empty(shape, np.float32), np.empty(shape, np.float32)
        for number, frame in enumerate(until_canceled(iter(simulation))):
            positions[number], velocities[number] = frame
        return SimulatedScene(index, simulation.scene, positions, velocities)

    return simulate_valid_scene(sampler, index, collect)
