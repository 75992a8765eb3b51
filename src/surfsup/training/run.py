"""A training run and its folder: what it needs to stop at any moment and go on as if it had not."""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from pydantic import ValidationError
from torch import Tensor

from surfsup.errors import InputError
from surfsup.learned.registry import KINDS
from surfsup.learned.training_domain import TrainingDomain
from surfsup.optim.checkpoint import Checkpoint, CheckpointFiles
from surfsup.optim.soap import Soap
from surfsup.sph.simulator import Simulator
from surfsup.training.config import TrainingConfig
from surfsup.training.devices import fabric_on
from surfsup.training.objectives import Batch, objective_for

if TYPE_CHECKING:
    from lightning_fabric import Fabric


class Run:
    """One training run and its folder: configuration, checkpoint, log and the best weights so far.

    Attributes:
        model: what is trained.
        average: its moving average, which is judged and kept.
        objective: what is minimized; ``loss`` is the same, wrapped for the devices.
        step: how many are done.
        judged: the step at which the last rollouts were.
        best: rank of the best weights so far.
        seconds: of training.
        seen: what the windows were like; of the first process, where there are several.
        under_way: batches whose rollouts go on, by the step at which they were new.
        stood: where the rollouts of a resumed run stood, each window's tensors; each is taken out when it goes on.
        untouched: whether the weights are still the random ones.
    """

    def __init__(self, config: TrainingConfig, folder: Path, fabric: Fabric | None = None) -> None:
        """Make the model of ``config`` with random weights; on the CPU where no ``fabric`` is given.

        Raises:
            InputError: Lightning Fabric is not installed, or the batch does not go evenly into the processes.
        """
        self.config, self.folder, self.fabric = config, folder, fabric or fabric_on("cpu")
        if config.batch % self.fabric.world_size:
            raise InputError(
                f"a batch of {config.batch} does not go evenly into {self.fabric.world_size} processes; "
                f"give batch={self.fabric.world_size} or a multiple"
            )
        torch.manual_seed(config.seed)
        self.model: Simulator = KINDS[config.kind](config.architecture)
        self.average = deepcopy(self.model).requires_grad_(False).to(self.fabric.device)
        self.objective = objective_for(self.model, config)
        optimizer = optimizer_of(config, self.model)
        self.loss, self.optimizer = self.fabric.setup(self.objective, optimizer)
        self.files = CheckpointFiles(folder)
        self.step = self.judged = 0
        self.best = math.inf
        self.seconds = 0.0
        self.seen: TrainingDomain | None = None
        self.untouched = True
        self.under_way: dict[int, Batch] = {}
        self.stood: dict[int, list[dict[str, Tensor]]] = {}

    def start_from(self, simulator: Simulator) -> None:
        """Begin with the weights of a trained simulator instead of random ones.

        Raises:
            InputError: it is of another kind or architecture.
        """
        if simulator.kind != self.model.kind or simulator.architecture != self.model.architecture:
            raise InputError(
                f"the weights to start from are of '{simulator.kind}', {simulator.architecture}; the run asks for "
                f"'{self.model.kind}', {self.model.architecture}"
            )
        self.model.load_state_dict(simulator.state_dict())
        self.average.load_state_dict(simulator.state_dict())
        self.untouched = False

    def save(self) -> None:
        """Write all that the run needs to go on; where there are several processes, only the first does.

        Raises:
            InputError: the disk is full or not writable.
        """
        if not self.fabric.is_global_zero:
            return
        tensors = {f"model.{name}": value for name, value in self.model.state_dict().items()}
        tensors |= {f"average.{name}": value for name, value in self.average.state_dict().items()}
        for number, state in self.plain_optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{number}.{name}": value for name, value in state.items()}
        standing = {began: [vars(state) for state in batch.states or ()] for began, batch in self.under_way.items()}
        for began, states in (self.stood | standing).items():  # of a run that was resumed a moment ago some still wait
            for number, state in enumerate(states):
                tensors |= {f"rollout.{began}.{number}.{name}": value for name, value in state.items()}
        counters = {
            "step": self.step,
            "judged": self.judged,
            "best": self.best,
            "seconds": self.seconds,
            "seen": None if self.seen is None else asdict(self.seen),
        }
        self.files.save(Checkpoint(tensors, counters, self.config.model_dump_json()))

    def resume(self) -> None:
        """Go on from the checkpoint in the folder.

        Raises:
            InputError: there is none, it is cut off, or it belongs to another configuration.
        """
        checkpoint = self.files.load()
        try:
            same = TrainingConfig.model_validate_json(checkpoint.config) == self.config
        except ValidationError:
            same = False
        if not same:
            raise InputError(f"{self.files.last}: belongs to a run of another configuration; take a new folder")
        try:
            self._take(checkpoint.tensors, checkpoint.counters)
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            reason = " ".join(str(error).split())[:120]
            raise InputError(f"{self.files.last}: is no checkpoint of this version ({reason})") from None

    def _take(self, tensors: dict[str, Tensor], counters: dict[str, Any]) -> None:
        self.model.load_state_dict(part_of(tensors, "model."))
        self.average.load_state_dict(part_of(tensors, "average."))
        states: dict[int, dict[str, Tensor]] = {}
        for name, value in part_of(tensors, "optimizer.").items():
            number, key = name.split(".", 1)
            states.setdefault(int(number), {})[key] = value
        stood: dict[int, dict[int, dict[str, Tensor]]] = {}
        for name, value in part_of(tensors, "rollout.").items():
            began, number, key = name.split(".", 2)
            place = stood.setdefault(int(began), {}).setdefault(int(number), {})
            place[key] = value.to(self.fabric.device)
        if self.fabric.is_global_zero:  # the windows of the other processes are others, and theirs were not saved
            self.stood = {began: [windows[number] for number in sorted(windows)] for began, windows in stood.items()}
        groups = self.plain_optimizer.state_dict()["param_groups"]
        self.plain_optimizer.load_state_dict({"state": states, "param_groups": groups})
        self.step, self.judged = counters["step"], counters["judged"]
        self.best, self.seconds = counters["best"], counters["seconds"]
        self.seen = None if counters["seen"] is None else TrainingDomain.from_json(counters["seen"])
        self.untouched = False

    @classmethod
    def average_of(cls, folder: Path) -> Simulator:
        """The averaged weights in the checkpoint of a run, whether or not they ever were its best.

        Raises:
            InputError: there is no checkpoint, or none that is whole and of this version.
        """
        files = CheckpointFiles(folder)
        try:
            checkpoint = files.load()
            run = cls(TrainingConfig.model_validate_json(checkpoint.config), folder)
            run.average.load_state_dict(part_of(checkpoint.tensors, "average."))
        except (ValidationError, KeyError, RuntimeError) as error:
            reason = " ".join(str(error).split())[:120]
            raise InputError(f"{files.last}: is no checkpoint of this version ({reason})") from None
        return run.average

    @property
    def plain_optimizer(self) -> torch.optim.Optimizer:
        """The optimizer without its wrapping."""
        return self.optimizer.optimizer


def optimizer_of(config: TrainingConfig, model: Simulator) -> torch.optim.Optimizer:
    """The optimizer of a run, for all weights of its model."""
    if config.optimizer == "soap":
        return Soap(model.parameters(), lr=config.learning_rate)
    return torch.optim.Adam(model.parameters(), lr=config.learning_rate, fused=True)


def part_of(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """The tensors whose name starts with ``prefix``, without it."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
