"""Training: windows in, weights out."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from surfsup.datasets.windows import WindowSource
from surfsup.evaluation.validation_scores import ValidationScores
from surfsup.optim.loop import Progress, optimize
from surfsup.training.batches import Batches, fit_normalizers
from surfsup.training.run import TrainingRun
from surfsup.training.validation import check_validation, keep_best


class Log(Protocol):
    """Records the progress of a run."""

    def add_step(self, run: TrainingRun, progress: Progress[ValidationScores]) -> None:
        """Record a step."""

    def add_rollouts(self, run: TrainingRun, scores: ValidationScores) -> None:
        """Record a validation of the averaged weights."""


def train(
    run: TrainingRun,
    windows: WindowSource,
    validation: Path,
    stop: Callable[[], bool] = lambda: False,
    report: Callable[[Progress[ValidationScores]], None] | None = None,
    log: Log | None = None,
) -> None:
    """Train until all steps are done or ``stop`` returns True; a stopped run leaves a checkpoint.

    If torchrun has started several processes, all of them call this; the main one validates and writes.

    Args:
        run: the run, new or resumed.
        windows: the training data.
        validation: folder of trajectories that choose the best weights; never a test set.
        stop: called before every step and after every validation scene.
        report: called after every step.
        log: records every step and every validation.

    Raises:
        InputError: the validation folder has no trajectories, or ones that cannot be used.
        Diverged: the loss or its gradient is not finite; the last checkpoint is kept.
    """
    check_validation(validation, run.config.validation_scenes)
    start_with_data(run, windows)
    if run.has_initial_weights:
        fit_normalizers(windows, run)

    def validate() -> ValidationScores | None:
        scores = keep_best(run, validation, stop) if run.is_main_process else None
        run.fabric.barrier()
        if log is not None and scores is not None:
            log.add_rollouts(run, scores)
        return scores

    def observe(progress: Progress[ValidationScores]) -> None:
        if log is not None:
            log.add_step(run, progress)
        if report is not None:
            report(progress)

    with Batches(windows, run) as batches:
        optimize(run, batches.at, validate, stop, observe)


def start_with_data(run: TrainingRun, windows: WindowSource) -> None:
    """Record the training data. If that of a resumed run has changed, warn, and start the rollouts of its batches anew.

    The saved states of these rollouts belong to windows that are drawn again, now from other scenes.
    """
    before, now = run.data_fingerprint, windows.fingerprint
    if before is None or now != before:
        run.saved_states = {}
    if before is not None and now is not None and now != before:
        warnings.warn(f"{run.folder}: the training data has changed; the run continues with the new data", stacklevel=3)
    run.data_fingerprint = now
