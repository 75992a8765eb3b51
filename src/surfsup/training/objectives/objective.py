"""What a training step minimizes: the base of all objectives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor, nn

from surfsup.datasets.windows import Window
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.simulator import FluidState, Simulator

if TYPE_CHECKING:
    from surfsup.training.config import Phase


class Batch:
    """Windows of equal length, for each a generator of all else that is random about it, and how far they are gone.

    With a generator to each window it makes no difference which process of several does which. This is no dataclass:
    Fabric would take one apart to look for tensors.

    Attributes:
        states: where the model has brought each window; None before the first step.
        done: how many steps of the model that took.
    """

    def __init__(self, windows: Sequence[Window], randoms: Sequence[np.random.Generator]) -> None:
        self.windows, self.randoms = windows, randoms
        self.states: Sequence[FluidState] | None = None
        self.done = 0


@dataclass(frozen=True)
class StepErrors:
    """How far off one predicted step of one window is; all of them scalars.

    Attributes:
        loss: what is minimized.
        near: mean squared error of the particles near the surface, NaN where there are none.
        far: the same of all others.
    """

    loss: Tensor
    near: Tensor
    far: Tensor


class Objective(nn.Module, ABC):
    """The loss of a batch, whose rollouts go on from where its last loss left them (push-forward).

    It is a module around the simulator, so that a whole step is one forward pass, as data-parallel training needs.

    Attributes:
        model: the simulator that is trained.
        frames_per_step: that a step of it goes.
    """

    def __init__(self, model: Simulator, frames_per_step: int = 1) -> None:
        super().__init__()
        self.model, self.frames_per_step = model, frames_per_step

    def forward(self, batch: Batch, phase: Phase) -> tuple[Tensor, Tensor]:
        """The loss of the next steps, and for each window (B, 3) its loss and its errors near to and far from solids.

        The batch is then that much further, without gradient.
        """
        states = batch.states or self.begin(batch, phase.noise)
        every: list[StepErrors] = []
        for number in range(batch.done, batch.done + phase.unroll):
            errors, reached = self.predict(states, batch, number, phase)
            every += errors
            states = [after(*given) for given in zip(states, reached, batch.windows, strict=True)]
        batch.states, batch.done = [state.detach() for state in states], batch.done + phase.unroll
        loss = torch.stack([one.loss for one in every]).mean()
        return loss, report(every, len(batch.windows))

    def begin(self, batch: Batch, noise: float) -> list[FluidState]:
        """The states that the windows begin with, which are true up to noise of ``noise`` meters."""
        return [
            self.with_noise(self.model.state_after(*window.up_to_now), 0.0 if window.begins else noise, random)
            for window, random in zip(batch.windows, batch.randoms, strict=True)
        ]

    def prepare(self, examples: Iterable[Window], randoms: Sequence[np.random.Generator], noise: float) -> None:
        """Take from examples what is not learned by descent; here there is no such thing."""

    @abstractmethod
    def with_noise(self, state: Any, size: float, random: np.random.Generator) -> Any:
        """A true state with errors as the model itself would have made, of ``size`` meters at most."""

    @abstractmethod
    def predict(
        self, states: list[Any], batch: Batch, number: int, phase: Phase
    ) -> tuple[list[StepErrors], list[tuple[Tensor, Tensor]]]:
        """Predict one step of every window.

        Args:
            states: of every window, before the step.
            batch: the windows.
            number: of the step in the window.
            phase: of training.

        Returns:
            For every window its errors, and the positions and velocities (N, 3) reached, before the guard.
        """


def after(state: FluidState, reached: tuple[Tensor, Tensor], window: Window) -> FluidState:
    """The handle_collisions state after a step from ``state`` to the positions and velocities ``reached``."""
    kept = resolve_collisions(state.positions, *reached, window.environment)
    return state.moved_to(kept.positions, kept.velocities)


def mean_where(values: Tensor, chosen: Tensor) -> Tensor:
    """The mean of ``values`` (N,) over the ``chosen`` (N,); NaN where none is. It waits for no device."""
    return torch.where(chosen, values.detach(), 0.0).sum() / chosen.sum()


def report(every: Sequence[StepErrors], windows: int) -> Tensor:
    """(windows, 3): each window's loss, error near to and far from the surface, means over its steps."""
    with torch.no_grad():
        rows = torch.stack([torch.stack([one.loss, one.near, one.far]) for one in every]).unflatten(0, (-1, windows))
        return torch.cat([rows[..., :1].mean(dim=0), rows[..., 1:].nanmean(dim=0)], dim=-1)
