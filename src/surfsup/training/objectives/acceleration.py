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
from surfsup.training.objectives.displaced_water import displace_water
from surfsup.training.objectives.drift import MAX_VELOCITY_DRIFT, clamp_length
from surfsup.training.objectives.objective import Objective, WindowLoss, masked_mean
from surfsup.training.objectives.outside_target import outside_target
from surfsup.training.objectives.small_errors import small_error_loss

NEAR_WEIGHT = 5.0  # lambda of the supplement


class AccelerationObjective(Objective[MessagePassingSimulator, History]):
    """The mean squared error over the particles; those near the surface have five times the weight.

    Attributes:
        bf16: whether the network computes in bfloat16; everything around it stays in single precision.
    """

    def __init__(self, model: MessagePassingSimulator, bf16: bool = False) -> None:
        super().__init__(model)
        self.bf16 = bf16

    def fit_normalizers(self, examples: Iterable[Window], randoms: Sequence[np.random.Generator], noise: float) -> None:
        """Measure the normalizers on states with training noise."""
        self.model.fit_normalizers(
            (self.add_noise(self.model.state_from_frames(*window.history), noise, random), true_displacement(window, 0))
            for window, random in zip(examples, randoms, strict=True)
        )

    def add_noise(self, state: History, std: float, random: np.random.Generator) -> History:
        """Add a random walk to the history; ``std`` is its standard deviation at the last displacement, meters."""
        return self.model.with_noise(state, std, torch.Generator().manual_seed(int(random.integers(2**63))))

    def disturb(self, state: History, window: Window, phase: Phase, random: np.random.Generator) -> History:
        """A true state with noise and, in the share of the windows that ``phase`` gives, with displaced water."""
        state = super().disturb(state, window, phase, random)
        if random.random() < phase.displaced:
            return displace_water(state, window.environment, random)
        return state

    def next_state(self, state: History, positions: Tensor, velocities: Tensor) -> History:
        """The state one frame after ``state``, at ``positions`` and with ``velocities`` (N, 3), without gradient."""
        return state.moved_to(positions, velocities).detach()

    def target_displacement(self, state: History, window: Window, number: int) -> Tensor:
        """The target (N, 3) of the displacement in the frame after frame ``number`` of a window, meters.

        It is the true displacement, as in GNS: the model must correct an error of the last displacement at once, and
        an error of the position not at all. Of an error beyond MAX_VELOCITY_DRIFT it must correct only that much. It
        does not lead into the solid or a wall, but out of them.
        """
        step, positions = MAX_VELOCITY_DRIFT * FRAME_TIME, state.positions.detach()
        drift = (state.displacements[:, 0] - true_displacement(window, number - 1)).detach()
        target = positions + true_displacement(window, number) + drift - clamp_length(drift, step)
        return outside_target(positions, target, step, window.environment) - positions

    def window_losses(
        self, states: Sequence[History], windows: Sequence[Window], number: int, phase: Phase
    ) -> list[WindowLoss]:
        """Predict one frame of every window, all in one pass of the network, and compare it with the truth."""
        inputs = batch_inputs(
            [self.model.network_input(state, window.environment) for state, window in zip(states, windows, strict=True)]
        )
        # Autocast only the network: products of positions in bfloat16 would be wrong by millimeters.
        with torch.autocast(inputs.node_features.device.type, torch.bfloat16, enabled=self.bf16):
            accelerations = self.model.predict_acceleration(inputs).split([len(state.positions) for state in states])
        losses = []
        for window, state, acceleration in zip(windows, states, accelerations, strict=True):
            positions, velocities = self.model.integrate(state, acceleration)
            target = self.model.acceleration_target(state, self.target_displacement(state, window, number))
            with torch.no_grad():
                near = window.environment.distance_and_normal(state.positions)[0] < NEAR_SURFACE_DISTANCE
            error = (acceleration - target).square().mean(dim=-1)
            loss = (torch.where(near, NEAR_WEIGHT, 1.0) * error).mean()
            if phase.small_errors > 0:
                loss = loss + phase.small_errors * small_error_loss(error).mean()
            if phase.density > 0:
                distance, _ = window.environment.distance_and_normal(positions)
                neighbors = find_neighbors(positions, KERNEL_SUPPORT)
                loss = loss + phase.density * density_loss(positions, neighbors, distance, window.environment)
            losses.append(WindowLoss(loss, masked_mean(error, near), masked_mean(error, ~near), positions, velocities))
        return losses


def true_displacement(window: Window, number: int) -> Tensor:
    """The true displacement (N, 3) from frame ``number`` of a window to the next, meters."""
    return window.frame(number + 1)[0] - window.frame(number)[0]
