"""The state of a training run."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from pydantic import ValidationError
from torch import Tensor

from surfsup.errors import InputError
from surfsup.learned.base import LearnedSimulator
from surfsup.learned.registry import LEARNED_SIMULATORS
from surfsup.learned.training_domain import TrainingDomain
from surfsup.optim.checkpoint import CheckpointFiles, summary, without_prefix
from surfsup.optim.run import Run, StepReport
from surfsup.optim.soap import Soap
from surfsup.training.config import TrainingConfig
from surfsup.training.devices import fabric_on
from surfsup.training.objectives import Batch, objective_for

if TYPE_CHECKING:
    from lightning_fabric import Fabric


class TrainingRun(Run[TrainingConfig, LearnedSimulator, Batch]):
    """A training run; its folder holds the checkpoints, the log and the best weights.

    Attributes:
        fabric: the device and the processes.
        objective: the loss that is minimized.
        window_errors: of the last batch, for each window the kind of its surface, its loss, and the mean squared errors
            near the surface and away from it.
        training_domain: ranges of the training data so far, of the main process.
        active_batches: batches with unfinished rollouts, by the step at which they were drawn.
        data_fingerprint: of the training data so far; None if it is not known or changes.
        saved_states: states of such rollouts in the checkpoint of a resumed run, for each window its tensors.
        has_initial_weights: whether the weights are still random.
    """

    def __init__(self, config: TrainingConfig, folder: Path, fabric: Fabric | None = None) -> None:
        """Create the model with random weights; without a ``fabric`` on the CPU.

        Raises:
            InputError: Lightning Fabric is not installed, or the batch cannot be split evenly over the processes.
        """
        self.fabric = fabric or fabric_on("cpu")
        if config.batch % self.fabric.world_size:
            raise InputError(
                f"a batch of {config.batch} cannot be split evenly over {self.fabric.world_size} processes; "
                f"give batch={self.fabric.world_size} or a multiple"
            )
        torch.manual_seed(config.seed)
        model: LearnedSimulator = LEARNED_SIMULATORS[config.kind](config.architecture).to(self.fabric.device)
        super().__init__(config, folder, model, create_optimizer(config, model))
        self.objective = objective_for(model, config)
        self._objective_on_processes = self.fabric.setup_module(self.objective)
        self.window_errors: list[tuple[str, float, float, float]] = []
        self.training_domain: TrainingDomain | None = None
        self.data_fingerprint: str | None = None
        self.active_batches: dict[int, Batch] = {}
        self.saved_states: dict[int, list[dict[str, Tensor]]] = {}
        self.has_initial_weights = True

    @property
    def is_main_process(self) -> bool:
        """Whether this process validates and writes."""
        return self.fabric.is_global_zero

    def mean_over_processes(self, value: float) -> float:
        """The mean of ``value`` over all processes."""
        if self.fabric.world_size == 1:
            return value
        mean = self.fabric.all_reduce(torch.tensor(value, device=self.fabric.device))
        assert isinstance(mean, Tensor)
        return float(mean)

    def start_from(self, simulator: LearnedSimulator) -> None:
        """Start with the weights of a trained simulator instead of random ones.

        Raises:
            InputError: the simulator has another kind or architecture.
        """
        if simulator.kind != self.model.kind or simulator.architecture != self.model.architecture:
            raise InputError(
                f"the weights to start from are of '{simulator.kind}', {simulator.architecture}; the run needs "
                f"'{self.model.kind}', {self.model.architecture}"
            )
        self.model.load_state_dict(simulator.state_dict())
        self.average.load_state_dict(simulator.state_dict())
        self.has_initial_weights = False

    def loss(self, batch: Batch) -> Tensor:
        """The loss of a batch; advances its rollouts.

        Raises:
            SimulationError: a rollout has diverged.
        """
        self.window_errors = [(kind, torch.nan, torch.nan, torch.nan) for kind in batch.surface_kinds()]
        loss, errors = self._objective_on_processes(batch, self.config.phase(self.step))
        self.window_errors = [(kind, *row) for kind, row in zip(batch.surface_kinds(), errors.tolist(), strict=True)]
        return loss

    def take_step(self, batch: Batch) -> StepReport:
        """Take one step of the optimizer and update the average.

        Raises:
            Diverged: the loss or its gradient is not finite; the weights are unchanged.
        """
        report = super().take_step(batch)
        for window in batch.windows:
            max_speed = float(window.velocities.square().sum(dim=-1).max().sqrt())
            domain = TrainingDomain.from_scene(window.scene, window.positions.shape[1], max_speed)
            self.training_domain = domain if self.training_domain is None else self.training_domain.union(domain)
        return report

    def divergence_message(self, batch: Batch) -> str:
        """Name the scenes whose loss is not finite; if only the gradient is not finite, all scenes of the batch."""
        finite = [abs(loss) < torch.inf for _, loss, _, _ in self.window_errors]
        names = {window.name for window, fine in zip(batch.windows, finite, strict=True) if all(finite) or not fine}
        kept = f"{self.files.last} is from before" if self.files.exist() else "no checkpoint had been written yet"
        return f"{super().divergence_message(batch)}, in {' or '.join(sorted(names))}; {kept}"

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """The tensors and counters of a checkpoint."""
        tensors, counters = super().state()
        active = {drawn: [vars(state) for state in batch.states or ()] for drawn, batch in self.active_batches.items()}
        for drawn, states in (self.saved_states | active).items():
            for number, state in enumerate(states):
                tensors |= {f"rollout.{drawn}.{number}.{name}": value for name, value in state.items()}
        counters["data_fingerprint"] = self.data_fingerprint
        counters["training_domain"] = None if self.training_domain is None else asdict(self.training_domain)
        return tensors, counters

    def load_state(self, tensors: dict[str, Tensor], counters: dict[str, Any]) -> None:
        """Restore what :meth:`state` returned.

        Raises:
            KeyError, TypeError, ValueError, RuntimeError: something is missing or of another shape.
        """
        super().load_state(tensors, counters)
        states: dict[int, dict[int, dict[str, Tensor]]] = {}
        for name, value in without_prefix("rollout.", tensors).items():
            drawn, number, key = name.split(".", 2)
            window = states.setdefault(int(drawn), {}).setdefault(int(number), {})
            window[key] = value.to(self.fabric.device)
        if self.is_main_process:  # the other processes have other windows, whose states were not saved
            self.saved_states = {drawn: [of[number] for number in sorted(of)] for drawn, of in states.items()}
        self.data_fingerprint = counters.get("data_fingerprint")
        domain = counters["training_domain"]
        self.training_domain = None if domain is None else TrainingDomain.from_json(domain)
        self.has_initial_weights = False


def create_optimizer(config: TrainingConfig, model: LearnedSimulator) -> torch.optim.Optimizer:
    """The optimizer of a run, for all weights of its model."""
    if config.optimizer == "soap":
        return Soap(model.parameters(), lr=config.learning_rate)
    return torch.optim.Adam(model.parameters(), lr=config.learning_rate, fused=True)


def load_average(folder: Path) -> LearnedSimulator:
    """The averaged weights in the last checkpoint of a run, whether or not they are its best.

    Raises:
        InputError: there is no checkpoint, or none that is complete and of this version.
    """
    files = CheckpointFiles(folder)
    try:
        checkpoint = files.load()
        config = TrainingConfig.model_validate_json(checkpoint.config)
        simulator = LEARNED_SIMULATORS[config.kind](config.architecture)
        simulator.load_state_dict(without_prefix("average.", checkpoint.tensors))
    except (ValidationError, KeyError, RuntimeError) as error:
        raise InputError(f"{files.last}: is not a checkpoint of a training run ({summary(error)})") from None
    return simulator.requires_grad_(False)
