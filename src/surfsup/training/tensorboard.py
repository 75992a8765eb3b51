"""The TensorBoard log of a run: curves over the steps and pictures of rollouts."""

from __future__ import annotations

import math
import time
import warnings
from collections import defaultdict
from pathlib import Path
from types import TracebackType

import numpy as np
from torch.utils.tensorboard import SummaryWriter

from surfsup.errors import InputError
from surfsup.evaluation.validation_scores import ValidationScores
from surfsup.io.trajectory_path import trajectory_files
from surfsup.optim.loop import Progress
from surfsup.training.rollout_picture import draw_rollout
from surfsup.training.run import TrainingRun
from surfsup.viewing.graphics import require_graphics

STEPS_PER_POINT = 50  # each point of a curve is a mean over these


def open_log(run: TrainingRun, validation: Path) -> TensorBoard:
    """A log with pictures of the first validation scene; without them, and with a warning, if rendering is impossible.

    Raises:
        InputError: the validation folder has no trajectories.
    """
    try:
        require_graphics()
    except InputError as error:
        warnings.warn(f"no pictures of rollouts: {error}", stacklevel=2)
        return TensorBoard(run, None)
    return TensorBoard(run, trajectory_files(validation)[0])


class TensorBoard:
    """Writes the folder ``tensorboard`` of a run; only the main process uses it.

    Use as a context manager. Points after the checkpoint of a resumed run are dropped.
    """

    def __init__(self, run: TrainingRun, pictured: Path | None) -> None:
        """Log ``run``; with every validation draw a rollout of the trajectory in ``pictured``, if one is given."""
        self._pictured = pictured
        self._writer = SummaryWriter(str(run.folder / "tensorboard"), purge_step=run.step + 1)
        self._values: dict[str, list[float]] = defaultdict(list)
        self._since = time.monotonic()

    def add_step(self, run: TrainingRun, progress: Progress[ValidationScores]) -> None:
        """Record a step; the means are written every :data:`STEPS_PER_POINT` steps."""
        values, last_step = self._values, progress.last_step
        values["loss"].append(last_step.loss)
        values["gradient norm"].append(last_step.gradient_norm)
        for surface, loss, near, far in run.window_errors:
            values[f"loss by surface/{surface}"].append(loss)
            values["error/near the surface"].append(near)
            values["error/far from the surface"].append(far)
        if progress.step % STEPS_PER_POINT:
            return
        for name, recorded in values.items():
            finite = [value for value in recorded if math.isfinite(value)]
            if finite:
                self._writer.add_scalar(name, float(np.mean(finite)), progress.step)
        now = time.monotonic()
        self._writer.add_scalar("learning rate", last_step.learning_rate, progress.step)
        self._writer.add_scalar("steps a second", len(values["loss"]) / (now - self._since), progress.step)
        self._since = now
        values.clear()

    def add_rollouts(self, run: TrainingRun, scores: ValidationScores) -> None:
        """Write the scores and draw a rollout; this time does not count towards the steps a second."""
        for name, value in vars(scores).items():
            self._writer.add_scalar(f"rollout/{name}", value, run.step)
        if self._pictured is not None:
            config = run.config
            picture = draw_rollout(run.average, self._pictured, config.validation_frames, config.validation_collisions)
            self._writer.add_image("rollout (below: the reference)", picture, run.step, dataformats="HWC")
        self._writer.flush()
        self._since = time.monotonic()

    def __enter__(self) -> TensorBoard:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._writer.close()
