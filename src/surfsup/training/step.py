"""One step of training: the loss of a batch, its gradient, the optimizer."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from surfsup.errors import SimulationError
from surfsup.optim.schedule import learning_rate
from surfsup.training.objectives import Batch
from surfsup.training.run import Run


class NotANumber(SimulationError):
    """The loss or its gradient stopped being a number; the message says at which step, in which scenes."""


@dataclass(frozen=True)
class StepReport:
    """What one step was like, in this process.

    Attributes:
        loss: of the batch.
        gradient: its norm, before it was clipped.
        rate: of learning.
        windows: for each window the kind of solid, its loss, and its errors near to and far from the surface.
    """

    loss: float
    gradient: float
    rate: float
    windows: list[tuple[str, float, float, float]]


def take_step(run: Run, batch: Batch) -> StepReport:
    """One step of the optimizer and of the average.

    Raises:
        NotANumber: the loss or its gradient is not finite; the weights are as they were.
    """
    config = run.config
    rate = learning_rate(config, run.step)
    for group in run.plain_optimizer.param_groups:
        group["lr"] = rate
    try:
        loss, rows = run.loss(batch, config.phase(run.step))
    except SimulationError:  # a rollout without gradient blew up
        raise no_number(run, batch, [True] * len(batch.windows)) from None
    run.optimizer.zero_grad()
    run.fabric.backward(loss)
    norm = run.fabric.clip_gradients(run.loss, run.optimizer, max_norm=config.clip, error_if_nonfinite=False)
    if not bool(torch.isfinite(loss.detach()) & torch.isfinite(norm)):
        raise no_number(run, batch, (~torch.isfinite(rows[:, 0])).tolist())
    run.optimizer.step()
    # A young average would remember the random start for too long.
    decay = min(config.averaging, (1 + run.step) / (10 + run.step))
    with torch.no_grad():
        for kept, new in zip(run.average.parameters(), run.model.parameters(), strict=True):
            kept.lerp_(new, 1 - decay)
    solids = [window.scene.surface.kind if window.scene.surface else "none" for window in batch.windows]
    told = [(solid, *row) for solid, row in zip(solids, rows.tolist(), strict=True)]
    return StepReport(float(loss.detach()), float(norm), rate, told)


def no_number(run: Run, batch: Batch, culprits: list[bool]) -> NotANumber:
    """The complaint; where only the gradient is no number, any window may have done it."""
    guilty = culprits if any(culprits) else [True] * len(culprits)
    names = sorted({window.name for window, is_so in zip(batch.windows, guilty, strict=True) if is_so})
    kept = f"{run.files.last} is from before" if run.files.exist() else "no checkpoint had been written yet"
    return NotANumber(f"the loss is not a number at step {run.step}, in {' or '.join(names)}; {kept}")
