"""The course of a run for TensorBoard: numbers over the steps, and pictures of rollouts."""

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
from surfsup.evaluation.validation_scores import Scores, first_trajectories
from surfsup.training.rollout_picture import draw_rollout
from surfsup.training.run import Run
from surfsup.training.step import StepReport
from surfsup.viewing.graphics import require_graphics

STEPS_A_POINT = 50  # that the curves' points are means over


def log_of(run: Run, validation: Path) -> TensorBoard:
    """A log with pictures of the first validation scene; without, and a warning, where this machine cannot draw."""
    try:
        require_graphics()
    except InputError as error:
        warnings.warn(f"no pictures of rollouts: {error}", stacklevel=2)
        return TensorBoard(run, None)
    return TensorBoard(run, first_trajectories(validation, 1)[0])


class TensorBoard:
    """Writes into the folder ``tensorboard`` of a run; of several processes the first does.

    Use as a context manager. What a run wrote after the checkpoint that it goes on from is dropped.
    """

    def __init__(self, run: Run, pictures_of: Path | None) -> None:
        """Log ``run``; every rollout with a picture of the trajectory in ``pictures_of``, if one is given."""
        self._pictures_of = pictures_of
        self._writer = SummaryWriter(str(run.folder / "tensorboard"), purge_step=run.step + 1)
        self._values: dict[str, list[float]] = defaultdict(list)
        self._since = time.monotonic()

    def add_step(self, step: int, report: StepReport) -> None:
        """Take in a step; every so many their means are written."""
        values = self._values
        values["loss"].append(report.loss)
        values["gradient norm"].append(report.gradient)
        for solid, loss, near, far in report.windows:
            values[f"loss by solid/{solid}"].append(loss)
            values["error/near the surface"].append(near)
            values["error/far from the surface"].append(far)
        if step % STEPS_A_POINT:
            return
        for name, every in values.items():
            known = [value for value in every if math.isfinite(value)]
            if known:
                self._writer.add_scalar(name, float(np.mean(known)), step)
        now = time.monotonic()
        self._writer.add_scalar("learning rate", report.rate, step)
        self._writer.add_scalar("steps a second", len(values["loss"]) / (now - self._since), step)
        self._since = now
        values.clear()

    def add_rollouts(self, run: Run, scores: Scores) -> None:
        """Write the scores, and draw a rollout; the time that takes does not count for the steps a second."""
        for name, value in vars(scores).items():
            self._writer.add_scalar(f"rollout/{name}", value, run.step)
        if self._pictures_of is not None:
            picture = draw_rollout(run.average, self._pictures_of, run.config.judge_frames)
            self._writer.add_image("rollout (below: the truth)", picture, run.step, dataformats="HWC")
        self._writer.flush()
        self._since = time.monotonic()

    def __enter__(self) -> TensorBoard:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._writer.close()
