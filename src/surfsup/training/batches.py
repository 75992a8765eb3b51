"""The batches of a run, read ahead of the optimizer. Each follows from the seed and the step at which it is drawn."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from types import TracebackType

import numpy as np

from surfsup.datasets.windows import WindowSource
from surfsup.errors import InputError
from surfsup.training.config import TrainingConfig
from surfsup.training.objectives import Batch
from surfsup.training.run import TrainingRun

READ_AHEAD = 8  # steps
NORMALIZATION_WINDOWS = 64  # windows that the normalizers of a new model are measured on
INTERLEAVED = 16  # batches whose rollouts alternate, so that consecutive losses come from different windows


class Batches:
    """The batch of each step. Use as a context manager; leaving it stops the reading thread.

    A batch with push-forward returns every :data:`INTERLEAVED` steps, until its rollouts have the length of the phase.
    The run keeps it meanwhile.
    """

    def __init__(self, windows: WindowSource, run: TrainingRun) -> None:
        self._windows, self._run = windows, run
        self._reader = ThreadPoolExecutor(1)
        self._ahead: dict[int, Future[Batch]] = {}

    def at(self, step: int) -> Batch:
        """This process's share of the batch of ``step``. Starts to read the next ones."""
        run = self._run
        for number in range(step, min(step + READ_AHEAD, run.config.steps)):
            if number not in self._ahead and drawn_at(run.config, number) == number:
                self._ahead[number] = self._reader.submit(read_batch, self._windows, run, number)
        drawn = drawn_at(run.config, step)
        if drawn == step:
            batch = self._ahead.pop(step).result()
        elif drawn in run.active_batches:
            batch = run.active_batches.pop(drawn)
        else:
            batch = restore_rollouts(read_batch(self._windows, run, drawn), run, drawn, step)
        if drawn_at(run.config, step + INTERLEAVED) == drawn:
            run.active_batches[drawn] = batch
        return batch

    def __enter__(self) -> Batches:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._reader.shutdown(cancel_futures=True)


def drawn_at(config: TrainingConfig, step: int) -> int:
    """The step at which the batch of ``step`` is drawn.

    Step s and step s + INTERLEAVED share a batch until its rollouts are complete. The slots start at different ages, so
    that at any time there are rollouts of every age.
    """
    phase, first = config.phase(step), config.first_step_of_phase(step)
    length = 1 + phase.pushforward
    turn, slot = divmod(step - first, INTERLEAVED)
    age = (turn + slot * length // INTERLEAVED) % length
    return step - min(age, turn) * INTERLEAVED


def read_batch(windows: WindowSource, run: TrainingRun, step: int) -> Batch:
    """This process's share of the batch that is drawn at ``step``.

    The windows are as long as the rollouts of the phase. Every window has its own random generator, seeded by its
    number in the whole batch.
    """
    config, phase, fabric = run.config, run.config.phase(step), run.fabric
    share = config.batch // fabric.world_size
    numbers = range(fabric.global_rank * share, (fabric.global_rank + 1) * share)
    randoms = [np.random.default_rng([config.seed, step, number]) for number in numbers]
    past, frames = run.model.history_length, 1 + phase.pushforward
    return Batch([windows.sample(random, past, frames, phase.scene_starts) for random in randoms], randoms)


def restore_rollouts(batch: Batch, run: TrainingRun, drawn: int, step: int) -> Batch:
    """The batch of a resumed run with the states at ``step`` from its checkpoint.

    Only the main process saves its states; elsewhere the rollouts start again.
    """
    saved = run.saved_states.pop(drawn, [])
    if len(saved) == len(batch.windows):
        states = run.objective.true_states(batch)
        batch.states = [replace(state, **tensors) for state, tensors in zip(states, saved, strict=True)]
        batch.age = (step - drawn) // INTERLEAVED
    return batch


def fit_normalizers(windows: WindowSource, run: TrainingRun) -> None:
    """Measure the normalizers of a new model on windows of the training data.

    Raises:
        InputError: the model has features of the surface, but none of the windows has a surface.
    """
    config = run.config
    randoms = [np.random.default_rng([config.seed, config.steps, number]) for number in range(NORMALIZATION_WINDOWS)]
    examples = [windows.sample(random, run.model.history_length, 1) for random in randoms]
    needs_surfaces = getattr(run.model, "surface_feature_count", 0) > 0
    if needs_surfaces and all(window.environment.surface is None for window in examples):
        raise InputError(
            f"kind '{config.kind}' learns from the surfaces of scenes, but the training data has none; add scenes with "
            "a surface, or train kind 'no-sdf'"
        )
    run.objective.fit_normalizers(examples, randoms, config.phase(0).noise)
    run.average.load_state_dict(run.model.state_dict())
