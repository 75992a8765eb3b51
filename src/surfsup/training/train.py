"""The training loop: windows in, weights out; it stops when told and goes on where it stopped."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup.datasets.windows import Window, WindowSource
from surfsup.errors import SimulationError
from surfsup.evaluation.judge import Scores, first_trajectories, judge
from surfsup.model import weights
from surfsup.training.config import TrainingConfig
from surfsup.training.run import Run
from surfsup.training.step import take_step
from surfsup.trajectory import Trajectory

READ_AHEAD = 8  # batches that reading is ahead of the optimiser
SAVE_EVERY = 500  # steps: what a kill loses at most


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


class NotANumber(SimulationError):
    """The loss stopped being a number; the message says at which step."""


def train(
    run: Run,
    windows: WindowSource,
    validation: Path,
    until: float = math.inf,
    report: Callable[[Progress], None] | None = None,
) -> None:
    """Train until the configuration's steps are done or the time is up.

    Args:
        run: what to train; it may have been resumed.
        windows: what to train on.
        validation: folder of trajectories that choose the checkpoint; never a test set.
        until: ``time.monotonic()`` value at which to stop with a checkpoint.
        report: told how it goes, every step.

    Raises:
        InputError: the validation folder has no trajectories.
        NotANumber: the loss became NaN; the checkpoint before it is kept.
    """
    config = run.config
    check_validation(validation)
    run.folder.mkdir(parents=True, exist_ok=True)
    began, base, smoothed = time.monotonic(), run.seconds, math.nan
    first_step = run.step
    # What is random in a step follows from its number, so a resumed run sees what an undisturbed one would.
    with ThreadPoolExecutor(1) as reader:
        ahead = {
            step: reader.submit(read_batch, windows, config, step)
            for step in range(run.step, min(run.step + READ_AHEAD, config.last_step))
        }
        while run.step < config.last_step and time.monotonic() < until:
            batch, random = ahead.pop(run.step).result()
            if run.step + READ_AHEAD < config.last_step:
                ahead[run.step + READ_AHEAD] = reader.submit(read_batch, windows, config, run.step + READ_AHEAD)
            loss = take_step(run, batch, random)
            if not math.isfinite(loss):
                raise NotANumber(f"the loss is not a number at step {run.step}; {run.checkpoint} is from before")
            smoothed = loss if math.isnan(smoothed) else 0.99 * smoothed + 0.01 * loss
            run.step += 1
            run.seconds = base + time.monotonic() - began
            scores = None
            if run.step % config.judge_every == 0 or run.step == config.last_step:
                scores = keep_the_best(run, validation, smoothed)
            if scores is not None or run.step % SAVE_EVERY == 0:
                run.save()
            if report is not None:
                speed = (time.monotonic() - began) / (run.step - first_step)
                report(Progress(run.step, config.last_step, smoothed, speed * (config.last_step - run.step), scores))
        for waiting in ahead.values():
            waiting.cancel()
    run.save()


def check_validation(folder: Path) -> None:
    """Find out now, not at the first rollouts, that there is nothing to judge by.

    Raises:
        InputError: the folder has no trajectories, or the first is none.
    """
    Trajectory(first_trajectories(folder, 1)[0]).close()


def read_batch(windows: WindowSource, config: TrainingConfig, step: int) -> tuple[list[Window], np.random.Generator]:
    """The windows of ``step`` and the generator that the rest of the step draws from."""
    random = np.random.default_rng([config.seed, step])
    phase = config.phase(step)
    frames = phase.unroll + (int(random.integers(phase.unseen + 1)) if phase.unseen else 0)
    return [windows.draw(random, frames) for _ in range(config.batch)], random


def keep_the_best(run: Run, validation: Path, loss: float) -> Scores:
    """Roll out the averaged weights, log the scores, and keep the weights if they are the best so far."""
    config = run.config
    scores = judge(run.average, validation, config.judge_scenes, config.judge_frames)
    log = run.folder / "log.csv"
    new = not log.exists()
    with log.open("a", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(["step", "seconds", "loss", *vars(scores)])
        writer.writerow([run.step, f"{run.seconds:.0f}", f"{loss:.5f}", *(f"{v:.6g}" for v in vars(scores).values())])
    if scores.rank < run.best:
        run.best = scores.rank
        about = f"step {run.step} of {config.model_dump_json()}; on validation scenes: {scores}"
        weights.save(run.folder / "best.safetensors", run.average, weights.Card(run.folder.name, about))
    return scores


__all__ = ["NotANumber", "Progress", "Run", "train"]
