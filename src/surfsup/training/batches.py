"""The batches of a run, read ahead of the optimizer; each follows from the seed and the step that it begins at."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from types import TracebackType

import numpy as np

from surfsup.datasets.windows import WindowSource
from surfsup.training.config import TrainingConfig
from surfsup.training.objectives import Batch
from surfsup.training.run import Run

READ_AHEAD = 8  # steps that reading is ahead of the optimizer
EXAMPLES = 64  # windows that a new model's normalizations are measured on
UNDER_WAY = 16  # batches that take turns: other windows come between two losses of the same


class Batches:
    """The batch of each step, new or gone on with; use as a context manager, leaving it stops the thread that reads.

    A batch whose rollouts go on comes again after :data:`UNDER_WAY` steps, until they are as long as the phase says.
    Meanwhile the run keeps it.
    """

    def __init__(self, windows: WindowSource, run: Run) -> None:
        self._windows, self._run = windows, run
        self._reader = ThreadPoolExecutor(1)
        self._ahead: dict[int, Future[Batch]] = {}

    def of(self, step: int) -> Batch:
        """What this process does of the batch of ``step``; the next ones are being read meanwhile."""
        run = self._run
        for number in range(step, min(step + READ_AHEAD, run.config.last_step)):
            if number not in self._ahead and beginning(run.config, number) == number:
                self._ahead[number] = self._reader.submit(read_batch, self._windows, run, number)
        began = beginning(run.config, step)
        if began == step:
            batch = self._ahead.pop(step).result()
        elif began in run.under_way:
            batch = run.under_way.pop(began)
        else:
            batch = gone_on_with(read_batch(self._windows, run, began), run, began, step)
        if beginning(run.config, step + UNDER_WAY) == began:
            run.under_way[began] = batch
        return batch

    def __enter__(self) -> Batches:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._reader.shutdown(cancel_futures=True)


def beginning(config: TrainingConfig, step: int) -> int:
    """The step at which the batch of ``step`` is new.

    Batches take turns, each until it has had all of its steps; then another takes its place. They do so one after the
    other, so that at any time there are rollouts of every age.
    """
    phase, first = config.phase(step), config.first_step(step)
    turns = 1 + phase.unseen // phase.unroll
    turn, place = divmod(step - first, UNDER_WAY)
    had = (turn + place * turns // UNDER_WAY) % turns
    return step - min(had, turn) * UNDER_WAY


def read_batch(windows: WindowSource, run: Run, step: int) -> Batch:
    """What this process does of the batch that is new at ``step``: windows as long as its rollouts will be.

    Every window has its number, and a generator that follows from it.
    """
    config, phase, fabric = run.config, run.config.phase(step), run.fabric
    share = config.batch // fabric.world_size
    numbers = range(fabric.global_rank * share, (fabric.global_rank + 1) * share)
    randoms = [np.random.default_rng([config.seed, step, number]) for number in numbers]
    past, frames = run.model.past, (phase.unseen + phase.unroll) * run.objective.frames_per_step
    return Batch([windows.draw(random, past, frames, phase.starts) for random in randoms], randoms)


def gone_on_with(batch: Batch, run: Run, began: int, step: int) -> Batch:
    """A batch of a resumed run, where its checkpoint says that it stood at ``step``.

    Where that is not known, as of any process but the first, its rollouts begin anew.
    """
    config, stood = run.config, run.stood.pop(began, [])
    if len(stood) == len(batch.windows):
        states = run.objective.begin(batch, noise=0.0)
        batch.states = [replace(state, **tensors) for state, tensors in zip(states, stood, strict=True)]
        batch.done = (step - began) // UNDER_WAY * config.phase(step).unroll
    return batch


def prepare(windows: WindowSource, run: Run) -> None:
    """Give a new model's objective examples to take from what is not learned by descent."""
    config = run.config
    randoms = [np.random.default_rng([config.seed, config.steps, number]) for number in range(EXAMPLES)]
    examples = (windows.draw(random, run.model.past, run.objective.frames_per_step) for random in randoms)
    run.objective.prepare(examples, randoms, config.phase(0).noise)
    run.average.load_state_dict(run.model.state_dict())
