"""The base of all objectives: the loss of one step of a batch of rollouts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from surfsup.datasets.windows import Window
from surfsup.learned.base import LearnedSimulator
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.simulator import FluidState

if TYPE_CHECKING:
    from surfsup.training.config import Phase

State = TypeVar("State", bound=FluidState)
Model = TypeVar("Model", bound=LearnedSimulator)


class Batch:
    """Windows of equal length, a random generator for each, and the states of their rollouts.

    Each window has its own generator, so that the distribution of windows over processes changes nothing. This is not a
    dataclass, because Fabric would search one for tensors.

    Attributes:
        states: the current state of each window's rollout; None before the first step.
        age: number of steps that the rollouts have taken.
    """

    def __init__(self, windows: Sequence[Window], randoms: Sequence[np.random.Generator]) -> None:
        self.windows, self.randoms = windows, randoms
        self.states: Sequence[FluidState] | None = None
        self.age = 0

    def surface_kinds(self) -> list[str]:
        """The kind of each window's surface, 'none' without one."""
        return [window.scene.surface_kind for window in self.windows]


@dataclass(frozen=True)
class WindowLoss:
    """The loss of one predicted step of one window.

    Attributes:
        loss: the loss, a scalar.
        near: mean squared error of the particles near the surface, a scalar; NaN if there are none.
        far: the same of all other particles.
        positions, velocities: (N, 3) after the step, before collision handling.
    """

    loss: Tensor
    near: Tensor
    far: Tensor
    positions: Tensor
    velocities: Tensor


class Objective(nn.Module, ABC, Generic[Model, State]):
    """The loss of a batch whose rollouts continue from the state of its last loss (push-forward).

    The objective is a module around the simulator, so that a training step is a single forward pass, as data-parallel
    training needs.

    Attributes:
        model: the simulator that is trained.
    """

    def __init__(self, model: Model) -> None:
        super().__init__()
        self.model = model

    def forward(self, batch: Batch, phase: Phase) -> tuple[Tensor, Tensor]:
        """The loss of the next step, and for each window (B, 3) its loss and its errors near and far from the surface.

        The rollouts of the batch advance by this step, without gradient.
        """
        states: Sequence[State] = batch.states or self.initial_states(batch, phase)  # type: ignore[assignment]  # states of its own simulator
        losses = self.window_losses(states, batch.windows, batch.age, phase)
        next_states: list[FluidState] = []
        for state, window, one in zip(states, batch.windows, losses, strict=True):
            positions, velocities = one.positions.detach(), one.velocities.detach()
            if phase.handle_collisions:
                result = resolve_collisions(state.positions, positions, velocities, window.environment)
                positions, velocities = result.positions, result.velocities
            next_states.append(self.next_state(state, positions, velocities))
        batch.states, batch.age = next_states, batch.age + 1
        rows = torch.stack([torch.stack([one.loss.detach(), one.near, one.far]) for one in losses])
        return torch.stack([one.loss for one in losses]).mean(), rows

    def true_states(self, batch: Batch) -> list[State]:
        """The states of the windows at their present frames."""
        return [self.model.state_from_frames(*window.history) for window in batch.windows]

    def initial_states(self, batch: Batch, phase: Phase) -> list[State]:
        """The states that the rollouts begin with: the true ones with the disturbances of ``phase``."""
        return [
            self.disturb(state, window, phase, random)
            for state, window, random in zip(self.true_states(batch), batch.windows, batch.randoms, strict=True)
        ]

    def disturb(self, state: State, window: Window, phase: Phase, random: np.random.Generator) -> State:
        """A true state with noise; one at the start of its scene stays true.

        The standard deviation of the noise is drawn anew for every window, so that calm states stay calm.
        """
        if window.at_scene_start or phase.noise == 0:
            return state
        return self.add_noise(state, phase.noise * 10 ** random.uniform(-phase.noise_decades, 0), random)

    def fit_normalizers(self, examples: Iterable[Window], randoms: Sequence[np.random.Generator], noise: float) -> None:
        """Measure the normalizers of the model on examples; by default there are none."""

    @abstractmethod
    def add_noise(self, state: State, std: float, random: np.random.Generator) -> State:
        """A true state with errors like those of the model, of about ``std`` meters."""

    @abstractmethod
    def next_state(self, state: State, positions: Tensor, velocities: Tensor) -> State:
        """The state one frame after ``state``, at ``positions`` and with ``velocities`` (N, 3), without gradient."""

    @abstractmethod
    def window_losses(
        self, states: Sequence[State], windows: Sequence[Window], number: int, phase: Phase
    ) -> list[WindowLoss]:
        """Predict one step of every window and compare it with the truth.

        Args:
            states: the state of every window before the step.
            windows: the windows.
            number: the frame of the windows before the step, counted from the present one.
            phase: the phase of training.
        """


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """The mean of ``values`` (N,) where ``mask`` (N,) is True, NaN if it is nowhere; does not synchronize a GPU."""
    return torch.where(mask, values.detach(), 0.0).sum() / mask.sum()
