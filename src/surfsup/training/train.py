"""The training loop: windows in, weights out; it stops when told and goes on where it stopped."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import torch

from surfsup.datasets.windows import WindowSource
from surfsup.evaluation.validation_scores import Scores
from surfsup.learned.training_domain import TrainingDomain
from surfsup.training.batches import Batches, prepare
from surfsup.training.objectives import Batch
from surfsup.training.run import Run
from surfsup.training.step import NotANumber, StepReport, take_step
from surfsup.training.validation import check_validation, keep_the_best

SAVE_EVERY = 300.0  # seconds: what a kill loses at most


@dataclass(frozen=True)
class Progress:
    """How a run stands, for whoever shows it.

    Attributes:
        step: steps done.
        steps: in all.
        loss: moving average of the last steps' loss.
        seconds_left: until the end at the present speed.
        scores: of the last rollouts, if there were any in this step.
    """

    step: int
    steps: int
    loss: float
    seconds_left: float
    scores: Scores | None


class Log(Protocol):
    """Where the course of a run is written."""

    def add_step(self, step: int, report: StepReport) -> None:
        """A step was done."""

    def add_rollouts(self, run: Run, scores: Scores) -> None:
        """The averaged weights were judged."""


def train(
    run: Run,
    windows: WindowSource,
    validation: Path,
    stop: Callable[[], bool] = lambda: False,
    report: Callable[[Progress], None] | None = None,
    log: Log | None = None,
) -> None:
    """Train until the configuration's steps are done or ``stop`` says so.

    Where torchrun started several processes, all of them call this; the first judges and writes.

    Args:
        run: what to train; it may have been resumed.
        windows: what to train on.
        validation: folder of trajectories that choose the checkpoint; never a test set.
        stop: asked before every step; a run that stops leaves a checkpoint.
        report: told how it goes, every step.
        log: told what every step and all rollouts were like.

    Raises:
        InputError: the validation folder has no trajectories.
        NotANumber: the loss became NaN; the checkpoint before it is kept.
    """
    check_validation(validation, run.config.judge_scenes)
    run.folder.mkdir(parents=True, exist_ok=True)
    if run.untouched:
        prepare(windows, run)
    first, began, base = run.step, time.monotonic(), run.seconds
    smoothed, saved = math.nan, time.monotonic()
    judge_if_due(run, validation, smoothed, stop, log)
    with Batches(windows, run) as batches:
        while run.step < run.config.last_step and not agreed(run, stop()):
            batch = batches.of(run.step)
            now = take_step(run, batch)
            run.seen = with_batch(run.seen, batch)
            loss = mean_of_processes(run, now.loss)
            smoothed = loss if math.isnan(smoothed) else 0.99 * smoothed + 0.01 * loss
            run.step += 1
            run.seconds = base + time.monotonic() - began
            if log is not None:
                log.add_step(run.step, now)
            scores = judge_if_due(run, validation, smoothed, stop, log)
            if time.monotonic() - saved > SAVE_EVERY:
                run.save()
                saved = time.monotonic()
            if report is not None:
                speed = (time.monotonic() - began) / (run.step - first)
                left = run.config.last_step - run.step
                report(Progress(run.step, run.config.last_step, smoothed, speed * left, scores))
    run.save()


def judge_if_due(run: Run, validation: Path, loss: float, stop: Callable[[], bool], log: Log | None) -> Scores | None:
    """Rollouts every so many steps and after the last, between two checkpoints; the other processes wait.

    A run that is killed meanwhile goes on with the rollouts.
    """
    due = run.step % run.config.judge_every == 0 or run.step == run.config.last_step
    if not due or run.judged == run.step:
        return None
    run.save()
    scores = keep_the_best(run, validation, loss, stop) if run.fabric.is_global_zero else None
    run.fabric.barrier()
    if scores is None and run.fabric.is_global_zero:
        return None
    run.judged = run.step
    run.save()
    if log is not None and scores is not None:
        log.add_rollouts(run, scores)
    return scores


def with_batch(seen: TrainingDomain | None, batch: Batch) -> TrainingDomain:
    """What was seen before and in the windows of a batch."""
    for window in batch.windows:
        fastest = float(window.velocities.square().sum(dim=-1).max().sqrt())
        own = TrainingDomain.of(window.scene, window.positions.shape[1], fastest)
        seen = own if seen is None else seen.joined(own)
    return seen


def agreed(run: Run, stop: bool) -> bool:
    """Whether any process wants to stop, so that none waits for another."""
    return mean_of_processes(run, float(stop)) > 0


def mean_of_processes(run: Run, value: float) -> float:
    """The mean over all processes of a number that each has."""
    if run.fabric.world_size == 1:
        return value
    return float(run.fabric.all_reduce(torch.tensor(value, device=run.fabric.device)))


__all__ = ["NotANumber", "Progress", "Run", "train"]
