"""The objective of the corrected simulator: the network's correction to the solver's velocities and positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from surfsup.datasets.windows import Window
from surfsup.learned.corrected.correction import POSITION_SHARE, Correction
from surfsup.learned.corrected.simulator import CorrectedSimulator, join_observations
from surfsup.scene import FRAME_TIME, NEAR_SURFACE_DISTANCE
from surfsup.sph.kernel_sums import KernelGraph
from surfsup.sph.solver import Observation
from surfsup.sph.state import ParticleState
from surfsup.training.config import Phase
from surfsup.training.objectives.correction_loss import (
    correction_loss,
    squared_error,
    target_correction,
)
from surfsup.training.objectives.drift import drift_weight
from surfsup.training.objectives.objective import Objective, WindowLoss, masked_mean
from surfsup.training.objectives.small_errors import small_error_loss


class CorrectionObjective(Objective[CorrectedSimulator, ParticleState]):
    """The scaled squared error and, in phases with that term, the logarithm of small errors."""

    def add_noise(self, state: ParticleState, std: float, random: np.random.Generator) -> ParticleState:
        """Add noise like the model's own error: position and velocity errors are correlated."""

        def draw() -> Tensor:
            return torch.from_numpy(random.normal(0, std, state.positions.shape).astype(np.float32)).to(state.positions)

        velocity_noise = draw() / FRAME_TIME
        position_noise = POSITION_SHARE * FRAME_TIME * velocity_noise + 0.5 * draw()
        return ParticleState(state.positions + position_noise, state.velocities + velocity_noise)

    def next_state(self, state: ParticleState, positions: Tensor, velocities: Tensor) -> ParticleState:
        """The state one frame after ``state``, at ``positions`` and with ``velocities`` (N, 3), without gradient."""
        return ParticleState(positions, velocities)

    def window_losses(
        self, states: Sequence[ParticleState], windows: Sequence[Window], number: int, phase: Phase
    ) -> list[WindowLoss]:
        """Predict one frame of every window, all in one pass of the network, and compare it with the truth."""
        observations = [
            detach_kernels(self.model.observe(state, window.environment))
            for state, window in zip(states, windows, strict=True)
        ]
        corrections = split(self.model.correct(join_observations(observations)), observations)
        losses = []
        for window, observation, correction in zip(windows, observations, corrections, strict=True):
            before, after = window.frame(number), window.frame(number + 1)
            target = target_correction(observation, before, after)
            weight = drift_weight(observation.state.positions - before[0]).detach()
            near = observation.last_query.distance < NEAR_SURFACE_DISTANCE
            loss, error = correction_loss(correction, target, near, weight), squared_error(correction, target)
            if phase.small_errors > 0:
                loss = loss + phase.small_errors * (weight * small_error_loss(error)).mean()
            positions, velocities = correction.added_to(observation.positions, observation.velocities)
            losses.append(WindowLoss(loss, masked_mean(error, near), masked_mean(error, ~near), positions, velocities))
        return losses


def detach_kernels(observation: Observation) -> Observation:
    """The observation without gradients through its kernels, which are constants of the step."""
    substep, graph = observation.substep, observation.substep.graph
    return replace(observation, substep=replace(substep, graph=KernelGraph(graph.neighbors, graph.kernels.detach())))


def split(joined: Correction, parts: list[Observation]) -> list[Correction]:
    """The correction of each of several scenes, from the joined one."""
    sizes = [len(part.positions) for part in parts]
    pairs = zip(joined.velocity.split(sizes), joined.position.split(sizes), strict=True)
    return [Correction(*pair) for pair in pairs]
