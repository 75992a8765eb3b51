"""The loop of every fit: steps, now and then a measurement and a checkpoint, until it is done or told to stop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from surfsup.errors import SimulationError
from surfsup.fitting.fit import Fit

SAVE_EVERY = 60.0  # seconds: what a kill loses at most
SMOOTHING = 0.98
RUNAWAY = 8.0  # times its smallest smoothed value: a loss above that has lost its way
WORSE = 3.0  # times the least error: likewise
SETTLED = 50  # steps after which a loss can run away


class Diverged(SimulationError):
    """A fit got worse instead of better; the best weights before are kept."""


@dataclass(frozen=True)
class Progress:
    """How a fit stands, for whoever shows it.

    Attributes:
        step, steps: done, and in all.
        loss: moving average.
        error: the last that was measured, NaN before.
        measured: whether that was in this step.
        seconds_left: until the end at the present speed.
    """

    step: int
    steps: int
    loss: float
    error: float
    measured: bool
    seconds_left: float


def run(fit: Fit, stop: Callable[[], bool] = lambda: False, report: Callable[[Progress], None] | None = None) -> None:
    """Fit until the configuration's steps are done or ``stop`` says so; a fit that stops leaves a checkpoint.

    Raises:
        Diverged: the loss is no number any more, or ran away; the best weights before that are in the checkpoint.
    """
    first, began, saved = fit.step, time.monotonic(), time.monotonic()
    base, processor_base, processor_began = fit.seconds, fit.processor_seconds, time.process_time()
    smoothed = lowest = error = math.nan
    while fit.step < fit.config.steps and not stop():
        loss = fit.take_step()
        smoothed = loss if math.isnan(smoothed) else SMOOTHING * smoothed + (1 - SMOOTHING) * loss
        lowest = smoothed if math.isnan(lowest) else min(lowest, smoothed)
        fit.seconds = base + time.monotonic() - began
        fit.processor_seconds = processor_base + time.process_time() - processor_began
        if not math.isfinite(loss) or (fit.step - first > SETTLED and smoothed > RUNAWAY * lowest):
            raise Diverged(end_of(fit, loss))
        measured = fit.step % fit.config.judge_every == 0
        if measured:
            error = fit.judge()
            if error > WORSE * fit.least:
                raise Diverged(end_of(fit, loss))
        if time.monotonic() - saved > SAVE_EVERY:
            fit.save()
            saved = time.monotonic()
        if report is not None:
            speed = (time.monotonic() - began) / (fit.step - first)
            left = speed * (fit.config.steps - fit.step)
            report(Progress(fit.step, fit.config.steps, smoothed, error, measured, left))
    if fit.step % fit.config.judge_every:
        fit.judge()
    fit.save()


def end_of(fit: Fit, loss: float) -> str:
    """What is said of a fit that diverged at ``loss``."""
    kept = f"the best before it, off by {fit.least:.4g}, is kept" if fit.best else "nothing had been measured before"
    lower = fit.config.learning_rate / 4
    return (
        f"the fit diverged at step {fit.step} (loss {loss:.4g}): {kept}; "
        f"start again with a lower learning_rate={lower:.2g}"
    )
