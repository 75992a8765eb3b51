"""The loop of every optimization: steps, validations and checkpoints until it is done or stopped."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from surfsup.optim.run import Batch, Config, Model, Run, StepReport

SAVE_EVERY = 60.0  # seconds: a kill loses at most this much work
SMOOTHING = 0.98  # decay of the moving average of the loss

Validation = TypeVar("Validation")


@dataclass(frozen=True)
class Progress(Generic[Validation]):
    """The state of a run after a step.

    Attributes:
        step, steps: steps taken, and in all.
        loss: moving average of the loss.
        seconds_left: until the end at the present speed.
        last_step: the step just taken.
        validation: the result of a validation after this step, None without one.
    """

    step: int
    steps: int
    loss: float
    seconds_left: float
    last_step: StepReport
    validation: Validation | None


def optimize(
    run: Run[Config, Model, Batch],
    batches: Callable[[int], Batch],
    validate: Callable[[], Validation | None],
    stop: Callable[[], bool] = lambda: False,
    report: Callable[[Progress[Validation]], None] | None = None,
) -> None:
    """Take steps until the configured number is reached or ``stop`` returns True; leave a checkpoint.

    With several processes all of them call this. A run that is killed during a validation repeats it when resumed.

    Args:
        run: the run, new or resumed.
        batches: returns the batch of a step, which counts from 0.
        validate: validates the averaged weights; returns None if it was stopped before the end.
        stop: called before every step.
        report: called after every step.

    Raises:
        Diverged: the loss or its gradient is not finite; the last checkpoint is kept.
    """
    first_step, seconds, processor_seconds = run.step, run.seconds, run.processor_seconds
    started, processor_started = time.monotonic(), time.process_time()
    saved = started
    validate_if_due(run, validate)
    while run.step < run.config.steps and not run.mean_over_processes(float(stop())):
        last_step = run.take_step(batches(run.step))
        loss = run.mean_over_processes(last_step.loss)
        old = loss if math.isnan(run.smoothed_loss) else run.smoothed_loss
        run.smoothed_loss = SMOOTHING * old + (1 - SMOOTHING) * loss
        run.seconds = seconds + time.monotonic() - started
        run.processor_seconds = processor_seconds + time.process_time() - processor_started
        validation = validate_if_due(run, validate)
        if time.monotonic() - saved > SAVE_EVERY:
            run.save()
            saved = time.monotonic()
        if report is not None:
            steps = run.config.steps
            left = (time.monotonic() - started) / (run.step - first_step) * (steps - run.step)
            report(Progress(run.step, steps, run.smoothed_loss, left, last_step, validation))
    run.save()


def validate_if_due(run: Run[Config, Model, Batch], validate: Callable[[], Validation | None]) -> Validation | None:
    """Validate after every ``validate_every`` steps and after the last one, between two checkpoints."""
    due = run.step % run.config.validate_every == 0 or run.step == run.config.steps
    if not due or run.validated_step == run.step:
        return None
    run.save()
    validation = validate()
    if validation is not None:
        run.validated_step = run.step
        run.save()
    return validation
