"""A network being fitted, and all that is needed to stop at any moment and go on as if it had not."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, TypeVar

import torch
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from torch import Tensor, nn

from surfsup.errors import InputError
from surfsup.optim.checkpoint import Checkpoint, CheckpointFiles
from surfsup.scene.validation_message import one_line
from surfsup.sdf.neural.surface_file import part
from surfsup.training.config import values_of


class FitConfig(BaseModel):
    """What every fit is told; those of a kind are told more.

    Attributes:
        steps: of the optimizer, over which the learning rate falls.
        learning_rate, final_learning_rate: of Adam, at the start and at the end of a cosine.
        warm_up: steps over which the learning rate rises.
        clip: the largest norm of the gradient; a longer one is shortened.
        averaging: decay of the moving average of the weights, which is what is judged and kept.
        judge_every: steps between two measurements.
        seed: of the first weights, the points and the order in which they come.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    steps: int = Field(default=8_000, ge=1)
    learning_rate: float = Field(default=5e-4, gt=0, allow_inf_nan=False)
    final_learning_rate: float = Field(default=1e-5, ge=0, allow_inf_nan=False)
    warm_up: int = Field(default=100, ge=0)
    clip: float = Field(default=1.0, gt=0)
    averaging: float = Field(default=0.998, ge=0, lt=1)
    judge_every: int = Field(default=500, ge=1)
    seed: int = Field(default=0, ge=0)

    def rate(self, step: int) -> float:
        """The learning rate at ``step``: a linear rise, then a cosine."""
        if step < self.warm_up:
            return self.learning_rate * (step + 1) / self.warm_up
        share = min(1.0, (step - self.warm_up) / max(1, self.steps - self.warm_up))
        low, high = self.final_learning_rate, self.learning_rate
        return low + 0.5 * (high - low) * (1 + math.cos(math.pi * share))


Config = TypeVar("Config", bound=FitConfig)


class Fit(ABC):
    """A network being fitted, its optimizer and its folder.

    Attributes:
        network: what is fitted.
        average: the moving average of its parameters, as they come.
        best: the parameters with the smallest error so far, empty before any was measured.
        least: that error.
        step: how many are done.
        seconds, processor_seconds: spent on them.
        files: of the checkpoint.
    """

    def __init__(self, config: FitConfig, network: nn.Module, folder: Path) -> None:
        self.config, self.network, self.folder = config, network, folder
        self.optimizer = torch.optim.Adam(network.parameters(), lr=config.learning_rate, betas=(0.9, 0.99), fused=True)
        self.average = [parameter.detach().clone() for parameter in network.parameters()]
        self.best: dict[str, Tensor] = {}
        self.least = math.inf
        self.step = 0
        self.seconds = self.processor_seconds = 0.0
        self.files = CheckpointFiles(folder)

    @abstractmethod
    def loss(self, random: torch.Generator) -> Tensor:
        """What is minimized, on points drawn by ``random``."""

    @abstractmethod
    def error(self) -> float:
        """How far the network is off on points that it was not fitted to; the least is kept."""

    def take_step(self) -> float:
        """One step of the optimizer; returns the loss. The weights stay as they were where it is not finite."""
        random = torch.Generator().manual_seed(self.config.seed * 1_000_003 + self.step)
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.rate(self.step)
        self.optimizer.zero_grad()
        loss = self.loss(random)
        value = float(loss.detach())
        if math.isfinite(value):
            loss.backward()
            norm = nn.utils.clip_grad_norm_(self.network.parameters(), self.config.clip)
            value = value if bool(torch.isfinite(norm)) else math.nan
        if math.isfinite(value):
            self.optimizer.step()
            self.step += 1
            decay = min(self.config.averaging, 1 - 1 / (self.step / 10 + 1))
            torch._foreach_lerp_(self.average, [p.detach() for p in self.network.parameters()], 1 - decay)
        return value

    def judge(self) -> float:
        """Measure the average and keep it if it is the best so far; returns its error."""
        own = [parameter.detach().clone() for parameter in self.network.parameters()]
        self.set_parameters(self.average)
        error = self.error()
        if error < self.least:
            self.least = error
            self.best = {name: value.detach().clone() for name, value in self.network.state_dict().items()}
        self.set_parameters(own)
        return error

    def set_parameters(self, values: list[Tensor]) -> None:
        """Give the network other parameters."""
        with torch.no_grad():
            for parameter, value in zip(self.network.parameters(), values, strict=True):
                parameter.copy_(value)

    def save(self) -> None:
        """Write all that the fit needs to go on.

        Raises:
            InputError: the disk is full or not writable.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        tensors = {f"network.{name}": value for name, value in self.network.state_dict().items()}
        tensors |= {f"average.{number}": value for number, value in enumerate(self.average)}
        tensors |= {f"best.{name}": value for name, value in self.best.items()}
        for number, state in self.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{number}.{name}": value for name, value in state.items()}
        counters: dict[str, Any] = {
            "step": self.step,
            "least": self.least,
            "seconds": self.seconds,
            "processor_seconds": self.processor_seconds,
        }
        self.files.save(Checkpoint(tensors, counters, self.config.model_dump_json()))

    def resume(self) -> None:
        """Go on from the checkpoint in the folder; ``steps`` alone may be others than those that it was begun with.

        With more steps the learning rate is from then on that of the longer fit at this step.

        Raises:
            InputError: there is none, it is cut off, or it belongs to other options or another input.
        """
        checkpoint = self.files.load()
        try:
            begun = type(self.config).model_validate_json(checkpoint.config)
            same = begun.model_copy(update={"steps": self.config.steps}) == self.config
        except ValidationError:
            same = False
        if not same:
            raise InputError(f"{self.files.last}: belongs to a fit with other options; give those, or another -o")
        tensors, counters = checkpoint.tensors, checkpoint.counters
        try:
            self.network.load_state_dict(part(tensors, "network."))
            self.average = [tensors[f"average.{number}"] for number in range(len(self.average))]
            self.best = part(tensors, "best.")
            states: dict[int, dict[str, Tensor]] = {}
            for name, value in part(tensors, "optimizer.").items():
                number, key = name.split(".", 1)
                states.setdefault(int(number), {})[key] = value
            groups = self.optimizer.state_dict()["param_groups"]
            self.optimizer.load_state_dict({"state": states, "param_groups": groups})
            self.step, self.least = counters["step"], counters["least"]
            self.seconds, self.processor_seconds = counters["seconds"], counters["processor_seconds"]
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            reason = " ".join(str(error).split())[:120]
            raise InputError(f"{self.files.last}: is no checkpoint of this fit ({reason})") from None


def config_of(kind: type[Config], overrides: list[str] | None) -> Config:
    """The options of a fit, its defaults changed by ``key=value``.

    Raises:
        InputError: an unknown key, or a value out of range.
    """
    try:
        return kind.model_validate(values_of(overrides or []))
    except ValidationError as error:
        raise InputError(f"options of the fit: {one_line(error, kind)}") from None
