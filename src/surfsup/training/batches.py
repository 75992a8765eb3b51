"""The batches of a run, read ahead of the optimiser; each follows from the seed and the number of its step alone."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType

import numpy as np

from surfsup.datasets.windows import WindowSource
from surfsup.training.objectives import Batch
from surfsup.training.run import Run

READ_AHEAD = 8  # batches that reading is ahead of the optimiser
EXAMPLES = 64  # windows that a new model's normalisations are measured on


class Batches:
    """A thread that reads; use as a context manager, leaving it stops the thread."""

    def __init__(self, windows: WindowSource, run: Run) -> None:
        self._windows, self._run = windows, run
        self._reader = ThreadPoolExecutor(1)
        self._ahead: dict[int, Future[Batch]] = {}

    def of(self, step: int) -> Batch:
        """What this process does of the batch of ``step``; the next ones are being read meanwhile."""
        for number in range(step, min(step + READ_AHEAD, self._run.config.last_step)):
            if number not in self._ahead:
                self._ahead[number] = self._reader.submit(read_batch, self._windows, self._run, number)
        return self._ahead.pop(step).result()

    def __enter__(self) -> Batches:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._reader.shutdown(cancel_futures=True)


def read_batch(windows: WindowSource, run: Run, step: int) -> Batch:
    """What this process does of the batch of ``step``: every window has its number, and a generator that follows."""
    config, phase, fabric = run.config, run.config.phase(step), run.fabric
    steps = phase.unroll
    if phase.unseen:
        steps += int(np.random.default_rng([config.seed, step]).integers(phase.unseen + 1))
    share = config.batch // fabric.world_size
    numbers = range(fabric.global_rank * share, (fabric.global_rank + 1) * share)
    randoms = [np.random.default_rng([config.seed, step, number]) for number in numbers]
    past, frames = run.model.past, steps * run.objective.frames_per_step
    return Batch([windows.draw(random, past, frames, phase.starts) for random in randoms], randoms)


def prepare(windows: WindowSource, run: Run) -> None:
    """Give a new model's objective examples to take from what is not learned by descent."""
    config = run.config
    randoms = [np.random.default_rng([config.seed, config.steps, number]) for number in range(EXAMPLES)]
    examples = (windows.draw(random, run.model.past, run.objective.frames_per_step) for random in randoms)
    run.objective.prepare(examples, randoms, config.phase(0).noise)
    run.average.load_state_dict(run.model.state_dict())
