"""The objective of the paper's networks: the squared error of the normalized acceleration."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from torch import Tensor

from surfsup.datasets.windows import Window
from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator, batch_inputs
from surfsup.scene import FRAME_TIME, NEAR_SURFACE_DISTANCE
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.training.config import Phase
from surfsup.training.objectives.density_loss import density_loss
from surfsup.training.objectives.objective import Batch, Objective, StepErrors, mean_where
from surfsup.training.objectives.strayed import FASTEST, at_most

NEAR_WEIGHT = 5.0  # lambda of the supplement


class AccelerationObjective(Objective):
    """Mean over the particles of the squared error, those near the surface counted five times.

    Attributes:
        bf16: whether the network computes in bfloat16; all around it stays in single precision.
    """

    model: MessagePassingSimulator

    def __init__(self, model: MessagePassingSimulator, bf16: bool = False) -> None:
        super().__init__(model)
        self.bf16 = bf16

    def prepare(self, examples: Iterable[Window], randoms: Sequence[np.random.Generator], noise: float) -> None:
        """Measure the normalizations on states with the training's noise."""
        self.model.fit_normalizers(
            (
                self.with_noise(self.model.state_after(*window.up_to_now), noise, random),
                self.true_step(window, 0)[0],
            )
            for window, random in zip(examples, randoms, strict=True)
        )

    def with_noise(self, state: History, size: float, random: np.random.Generator) -> History:
        """A random walk over the history; ``size`` is its spread at the last move."""
        if size == 0:
            return state
        return self.model.with_noise(state, size, torch.Generator().manual_seed(int(random.integers(2**63))))

    def true_step(self, window: Window, number: int) -> tuple[Tensor, Tensor]:
        """The true move in a step of a window, meters, and the true velocities after it, m/s; both (N, 3)."""
        before, _ = window.frame(number * self.frames_per_step)
        positions, velocities = window.frame((number + 1) * self.frames_per_step)
        return positions - before, velocities

    def asked_step(self, state: History, window: Window, number: int) -> tuple[Tensor, Tensor]:
        """The move and the velocities that are asked of ``state`` in a step of a window; both (N, 3).

        They are the true ones, as in GNS: so an error of the last move is to be made good at once, one of place not at
        all. Of a state that has strayed far no more is asked than of one that has strayed by the bounds.
        """
        last, last_velocities = self.true_step(window, number - 1)
        move, velocities = self.true_step(window, number)
        off, faster = (state.displacements[:, 0] - last).detach(), (state.velocities - last_velocities).detach()
        return move + off - at_most(off, FASTEST * FRAME_TIME), velocities + faster - at_most(faster, FASTEST)

    def predict(
        self, states: list[History], batch: Batch, number: int, phase: Phase
    ) -> tuple[list[StepErrors], list[tuple[Tensor, Tensor]]]:
        """One step of the model; all windows go through the network together."""
        windows = batch.windows
        seen = batch_inputs(
            [self.model.network_input(s, window.environment) for s, window in zip(states, windows, strict=True)]
        )
        # Around the network alone: a product of positions in bfloat16 would be off by millimeters.
        with torch.autocast(seen.node_features.device.type, torch.bfloat16, enabled=self.bf16):
            joined = self.model.predict_acceleration(seen)
        errors, reached = [], []
        every = joined.split([len(state.positions) for state in states])
        for window, state, predicted in zip(windows, states, every, strict=True):
            reached.append(self.model.integrate(state, predicted))
            wanted = self.model.acceleration_target(state, self.asked_step(state, window, number)[0])
            with torch.no_grad():
                near = window.environment.distance_and_normal(state.positions)[0] < NEAR_SURFACE_DISTANCE
            error = (predicted - wanted).square().mean(dim=-1)
            loss = (torch.where(near, NEAR_WEIGHT, 1.0) * error).mean()
            if phase.density > 0:
                positions = reached[-1][0]
                distance, _ = window.environment.distance_and_normal(positions)
                near_each_other = find_neighbors(positions, KERNEL_SUPPORT)
                loss = loss + phase.density * density_loss(positions, near_each_other, distance, window.environment)
            errors.append(StepErrors(loss, mean_where(error, near), mean_where(error, ~near)))
        return errors, reached
