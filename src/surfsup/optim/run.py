"""The state of an optimization, which can stop at any moment and resume as if it had not."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from pydantic import ValidationError
from torch import Tensor, nn

from surfsup.checked.tensors import finite_number, load_weights, whole_number
from surfsup.errors import InputError, SimulationError
from surfsup.optim.averaging import update_average
from surfsup.optim.checkpoint import (
    Checkpoint,
    CheckpointFiles,
    load_optimizer_state,
    optimizer_state,
    summary,
    with_prefix,
    without_prefix,
)
from surfsup.optim.config import Config
from surfsup.optim.schedule import learning_rate

MAX_STEP = 1 << 53
Model = TypeVar("Model", bound=nn.Module)
Batch = TypeVar("Batch")


class Diverged(SimulationError):
    """The loss or its gradient is not finite, or the loss has grown far above its minimum."""


@dataclass(frozen=True)
class StepReport:
    """One optimizer step, in this process.

    Attributes:
        loss: the loss of the batch.
        gradient_norm: norm of the gradient before clipping.
        learning_rate: the learning rate.
    """

    loss: float
    gradient_norm: float
    learning_rate: float


class Run(ABC, Generic[Config, Model, Batch]):
    """A model, its averaged weights, its optimizer and the folder of its checkpoints.

    Attributes:
        config: the options.
        folder: the folder of the run.
        model: the model that is optimized.
        average: a copy of the model with the moving average of its weights.
        optimizer: the optimizer.
        files: the checkpoints.
        step: number of steps taken.
        validated_step: the step of the last validation.
        best_score: the lowest validation score so far.
        seconds, processor_seconds: time spent.
        smoothed_loss: moving average of the loss; NaN before the first step.
    """

    def __init__(self, config: Config, folder: Path, model: Model, optimizer: torch.optim.Optimizer) -> None:
        self.config, self.folder, self.model, self.optimizer = config, folder, model, optimizer
        self.average = deepcopy(model).requires_grad_(False)
        self.files = CheckpointFiles(folder)
        self.step = self.validated_step = 0
        self.best_score = math.inf
        self.seconds = self.processor_seconds = 0.0
        self.smoothed_loss = math.nan

    @abstractmethod
    def loss(self, batch: Batch) -> Tensor:
        """The loss of a batch, a scalar.

        Raises:
            SimulationError: the loss cannot be computed, because the model has diverged.
        """

    def divergence_message(self, batch: Batch) -> str:
        """The error message for a loss or a gradient that is not finite."""
        return f"the loss is not a number at step {self.step}"

    @property
    def is_main_process(self) -> bool:
        """Whether this process validates and writes."""
        return True

    def mean_over_processes(self, value: float) -> float:
        """The mean of ``value`` over all processes."""
        return value

    def take_step(self, batch: Batch) -> StepReport:
        """Take one step of the optimizer and update the average.

        Raises:
            Diverged: the loss or its gradient is not finite; the weights are unchanged.
        """
        rate = learning_rate(self.config, self.step)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        self.optimizer.zero_grad()
        try:
            loss = self.loss(batch)
        except SimulationError:
            raise Diverged(self.divergence_message(batch)) from None
        loss.backward()
        norm = nn.utils.clip_grad_norm_(self.model.parameters(), self.config.clip)
        if not bool(torch.isfinite(loss.detach()) & torch.isfinite(norm)):
            raise Diverged(self.divergence_message(batch))
        self.optimizer.step()
        update_average(self.average, self.model, self.step, self.config.averaging)
        self.step += 1
        return StepReport(float(loss.detach()), float(norm), rate)

    def save(self) -> None:
        """Write a checkpoint; of several processes only the main one does.

        Raises:
            InputError: the disk is full or not writable.
        """
        if not self.is_main_process:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        tensors, counters = self.state()
        self.files.save(Checkpoint(tensors, counters, self.config.model_dump_json()))

    def resume(self) -> None:
        """Continue from the checkpoint in the folder.

        Raises:
            InputError: there is no checkpoint, it is damaged, or it belongs to another configuration.
        """
        checkpoint = self.files.load()
        try:
            same = self.continues(type(self.config).model_validate_json(checkpoint.config))
        except ValidationError:
            same = False
        if not same:
            raise InputError(
                f"{self.files.last}: belongs to a run of another configuration; give the same options or another -o"
            )
        try:
            self.load_state(checkpoint.tensors, checkpoint.counters)
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise InputError(f"{self.files.last}: is not a checkpoint of such a run ({summary(error)})") from None

    def continues(self, config: Config) -> bool:
        """Whether this run can continue from a checkpoint of a run with ``config``."""
        return config == self.config

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """The tensors and counters of a checkpoint."""
        tensors = with_prefix("model.", self.model.state_dict())
        tensors |= with_prefix("average.", self.average.state_dict())
        tensors |= with_prefix("optimizer.", optimizer_state(self.optimizer))
        counters = {
            "step": self.step,
            "validated_step": self.validated_step,
            "best_score": self.best_score,
            "smoothed_loss": self.smoothed_loss,
            "seconds": self.seconds,
            "processor_seconds": self.processor_seconds,
        }
        return tensors, counters

    def load_state(self, tensors: dict[str, Tensor], counters: dict[str, Any]) -> None:
        """Restore what :meth:`state` returned.

        Raises:
            KeyError, TypeError, ValueError, RuntimeError: something is missing or of another shape.
        """
        load_weights(self.model, without_prefix("model.", tensors))
        load_weights(self.average, without_prefix("average.", tensors))
        load_optimizer_state(self.optimizer, without_prefix("optimizer.", tensors))
        self.step = whole_number("step", counters["step"], 0, MAX_STEP)
        self.validated_step = whole_number("validated_step", counters["validated_step"], 0, self.step)
        best, loss = counters["best_score"], counters.get("smoothed_loss", math.nan)
        self.best_score = math.inf if best == math.inf else finite_number("best_score", best)
        self.smoothed_loss = math.nan if loss != loss else finite_number("smoothed_loss", loss)
        self.seconds = finite_number("seconds", counters["seconds"])
        self.processor_seconds = finite_number("processor_seconds", counters["processor_seconds"])
