"""A training run and its folder: what it needs to stop at any moment and go on as if it had not."""

from __future__ import annotations

import json
import math
from copy import deepcopy
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file, save_file

from surfsup.errors import InputError
from surfsup.model.simulator import Architecture, Simulator
from surfsup.training.config import TrainingConfig


class Run:
    """One training run and its folder: configuration, checkpoint, log and the best weights so far."""

    def __init__(self, config: TrainingConfig, folder: Path) -> None:
        torch.manual_seed(config.seed)
        self.config, self.folder = config, folder
        self.model = Simulator(Architecture(config.width, config.layers, config.radius))
        self.average = deepcopy(self.model).requires_grad_(False)
        self.optimizer = torch.optim.Adam(self.model.parameters(), lr=config.learning_rate, fused=True)
        self.step = 0
        self.best = math.inf
        self.seconds = 0.0

    def start_from(self, simulator: Simulator) -> None:
        """Begin with the weights of a trained simulator instead of random ones.

        Raises:
            InputError: it is of another architecture.
        """
        if simulator.architecture != self.model.architecture:
            raise InputError(
                f"the weights to start from are of {simulator.architecture}, the run asks for {self.model.architecture}"
            )
        self.model.load_state_dict(simulator.state_dict())
        self.average.load_state_dict(simulator.state_dict())

    @property
    def checkpoint(self) -> Path:
        """The file from which the run can go on."""
        return self.folder / "checkpoint.safetensors"

    def save(self) -> None:
        """Write all that the run needs to go on, so that a kill at any moment leaves a whole file."""
        tensors = {f"model.{name}": value for name, value in self.model.state_dict().items()}
        tensors |= {f"average.{name}": value for name, value in self.average.state_dict().items()}
        for number, state in self.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{number}.{name}": value for name, value in state.items()}
        header = {"step": self.step, "best": self.best, "seconds": self.seconds}
        partial = self.checkpoint.with_suffix(".partial")
        try:
            save_file(
                {name: value.contiguous() for name, value in tensors.items()},
                partial,
                metadata={"run": json.dumps(header), "config": self.config.model_dump_json()},
            )
            partial.replace(self.checkpoint)
        except (OSError, SafetensorError) as error:
            raise InputError(f"{self.checkpoint}: cannot be written ({error})") from None

    def resume(self) -> None:
        """Go on from the checkpoint in the folder.

        Raises:
            InputError: there is none, it is cut off, or it belongs to another configuration.
        """
        if not self.checkpoint.exists():
            raise InputError(f"{self.checkpoint}: there is no checkpoint to resume")
        try:
            with safe_open(self.checkpoint, framework="pt") as file:
                header = file.metadata() or {}
            if TrainingConfig.model_validate_json(header["config"]) != self.config:
                raise InputError(f"{self.checkpoint}: belongs to a run of another configuration; take a new folder")
            self._take(load_file(self.checkpoint), json.loads(header["run"]))
        except InputError:
            raise
        except (SafetensorError, OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
            reason = " ".join(str(error).split())[:120]
            raise InputError(f"{self.checkpoint}: is cut off or no checkpoint ({reason})") from None

    def _take(self, tensors: dict[str, torch.Tensor], counters: dict[str, float]) -> None:
        self.model.load_state_dict(part_of(tensors, "model."))
        self.average.load_state_dict(part_of(tensors, "average."))
        states: dict[int, dict[str, torch.Tensor]] = {}
        for name, value in part_of(tensors, "optimizer.").items():
            number, key = name.split(".", 1)
            states.setdefault(int(number), {})[key] = value
        groups = self.optimizer.state_dict()["param_groups"]
        self.optimizer.load_state_dict({"state": states, "param_groups": groups})
        self.step, self.best, self.seconds = counters["step"], counters["best"], counters["seconds"]


def part_of(tensors: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    """The tensors whose name starts with ``prefix``, without it."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
