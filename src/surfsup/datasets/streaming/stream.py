"""Simulations without end, handed over as each is finished while the workers go on."""

from __future__ import annotations

import os
import queue
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup.datasets.folder import LOCK, locked
from surfsup.datasets.generation.checked_simulation import Run, simulate_sound
from surfsup.datasets.generation.scene_sampler import Drawing
from surfsup.datasets.generation.worker_pool import Crew, crew, while_wanted
from surfsup.errors import InputError
from surfsup.scene import Scene

SURFACES = 100  # of a recipe that keeps its surfaces in files; the scenes take turns with them


@dataclass(frozen=True)
class Simulated:
    """A finished simulation in memory.

    Attributes:
        index: of the scene in the stream.
        scene: what was simulated.
        positions: (frames, N, 3) float32, meters.
        velocities: the same in m/s, at the end of each frame.
    """

    index: int
    scene: Scene
    positions: np.ndarray
    velocities: np.ndarray

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.positions)

    def window(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (count, N, 3) of ``count`` frames from ``first`` on."""
        return self.positions[first : first + count], self.velocities[first : first + count]


class Stream:
    """An endless iterator of simulations, in the order in which they get done; no scene comes twice.

    Never more than ``ahead`` of them are under way or waiting to be read, which bounds the memory. Reading one starts
    the next.
    """

    def __init__(self, drawing: Drawing, doers: Crew, ahead: int) -> None:
        """Start the first ``ahead`` simulations."""
        self._drawing, self._doers = drawing, doers
        self._done: queue.SimpleQueue[Future[Simulated]] = queue.SimpleQueue()
        self._index = 0
        for _ in range(ahead):
            self._start_next()

    def _start_next(self) -> None:
        self._doers.submit(simulate_in_memory, self._drawing, self._index).add_done_callback(self._done.put)
        self._index += 1

    def __iter__(self) -> Iterator[Simulated]:
        """Itself."""
        return self

    def __next__(self) -> Simulated:
        """The next simulation to be done; waits for it.

        Raises:
            SimulationError: no sound scene could be found for an index, or the scheduler was lost.
        """
        return self._take(self._doers.next_of(self._done))

    def ready(self) -> list[Simulated]:
        """All simulations that are done; waits for none.

        Raises:
            SimulationError: as reading them one by one does.
        """
        simulations = []
        with suppress(queue.Empty):
            while True:
                simulations.append(self._take(self._done.get_nowait()))
        return simulations

    def _take(self, done: Future[Simulated]) -> Simulated:
        simulated = done.result()
        self._start_next()
        return simulated


@contextmanager
def stream(
    recipe: str,
    folder: Path,
    seed: int = 0,
    frames: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    ahead: int | None = None,
) -> Iterator[Stream]:
    """Simulations of ``recipe`` without end; leaving the context stops the workers.

    Args:
        recipe: which scenes.
        folder: for the files of surfaces where the recipe has some. Only then all workers must see it under this path;
            simulations come back through the scheduler.
        seed: with a scene's number it decides everything about the scene.
        frames: of every scene; left out, as many as the recipe says.
        workers: simulations side by side on this machine, each on one core; 2 by default.
        scheduler: address of a dask scheduler whose workers do it instead.
        ahead: simulations under way or waiting at most; two for each that can run at once by default.

    Raises:
        InputError: no such recipe, ``ahead`` is not above zero, or there are no workers that can do it.
    """
    if ahead is not None and ahead < 1:
        raise InputError(f"asked to be {ahead} simulations ahead; there must be at least 1")
    folder = folder.resolve()
    drawing = Drawing(recipe, seed, frames, folder)
    with crew(workers, scheduler) as doers, locked(folder) as token:
        drawing.prepare(None, SURFACES)
        has_files = os.listdir(folder) != [LOCK]
        doers.require(folder if has_files else None, token)
        yield Stream(drawing, doers, ahead or 2 * doers.slots)


def simulate_in_memory(drawing: Drawing, index: int) -> Simulated:
    """Simulate scene ``index``."""

    def keep(run: Run) -> Simulated:
        positions, velocities = np.empty((2, run.scene.frames, run.particles, 3), dtype=np.float32)
        for frame, (now, speed) in enumerate(while_wanted(iter(run))):
            positions[frame], velocities[frame] = now, speed
        return Simulated(index, run.scene, positions, velocities)

    return simulate_sound(drawing, index, keep)
