"""The objective of the convolution: its correction to what the rule makes of a frame, of velocity and of position."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from surfsup.learned.corrected.correction import POSITION_SHARE, Correction
from surfsup.learned.corrected.simulator import CorrectedSimulator, Observation, join_observations
from surfsup.scene import NEAR_SURFACE_DISTANCE
from surfsup.sph.kernel_sums import Graph
from surfsup.sph.state import FRAME_TIME, ParticleState
from surfsup.training.config import Phase
from surfsup.training.objectives.correction_loss import (
    calm_loss,
    motion_loss,
    squared_error,
    wanted_correction,
)
from surfsup.training.objectives.objective import Batch, Objective, StepErrors, mean_where
from surfsup.training.objectives.strayed import weight_of

NOISE_DECADES = 2.0  # how many powers of ten smaller than the configured noise a window's may be


class CorrectionObjective(Objective):
    """Motion loss and, in phases that weigh it, the logarithm of errors."""

    model: CorrectedSimulator

    def with_noise(self, state: ParticleState, size: float, random: np.random.Generator) -> ParticleState:
        """A state as the model itself would have left it."""
        return with_error(state, size, random)

    def predict(
        self, states: list[ParticleState], batch: Batch, number: int, phase: Phase
    ) -> tuple[list[StepErrors], list[tuple[Tensor, Tensor]]]:
        """One frame; all windows go through the network together."""
        model, windows = self.model, batch.windows
        seen = [
            with_fixed_graph(model.observe(state, window.environment))
            for state, window in zip(states, windows, strict=True)
        ]
        corrections = split(model.correct(join_observations(seen)), seen)
        errors, reached = [], []
        for window, view, correction in zip(windows, seen, corrections, strict=True):
            reached.append(model.advance(view, correction))
            wanted = wanted_correction(view, window.frame(number), window.frame(number + 1))
            with torch.no_grad():
                sure = weight_of(view.state.positions - window.frame(number)[0])
                near = view.distance < NEAR_SURFACE_DISTANCE
            loss = motion_loss(correction, wanted, near, sure)
            if phase.calm > 0:
                loss = loss + phase.calm * calm_loss(correction, wanted, sure)
            error = squared_error(correction, wanted)
            errors.append(StepErrors(loss, mean_where(error, near), mean_where(error, ~near)))
        return errors, reached


def with_fixed_graph(seen: Observation) -> Observation:
    """The observation with its kernels taken as given.

    Their gradient would be passed back to the frame before, where it says little and costs as much as all
    the rest.
    """
    return replace(seen, graph=Graph(seen.graph.neighborhood, seen.graph.kernels.detach()))


def split(joined: Correction, parts: list[Observation]) -> list[Correction]:
    """The correction of several scenes side by side, scene by scene."""
    sizes = [len(part.ahead) for part in parts]
    pairs = zip(joined.velocity.split(sizes), joined.position.split(sizes), strict=True)
    return [Correction(*pair) for pair in pairs]


def with_error(state: ParticleState, size: float, random: np.random.Generator) -> ParticleState:
    """The state with noise that looks like an error of the model: those of place and of velocity go together.

    Its size is drawn anew for every window, from almost nothing up to ``size`` meters, so that a calm state stays calm.
    """
    if size == 0:
        return state
    own = size * 10 ** random.uniform(-NOISE_DECADES, 0)

    def draw() -> Tensor:
        return torch.from_numpy(random.normal(0, own, state.positions.shape).astype(np.float32)).to(state.positions)

    in_velocity = draw() / FRAME_TIME
    in_place = POSITION_SHARE * FRAME_TIME * in_velocity + 0.5 * draw()
    return ParticleState(state.positions + in_place, state.velocities + in_velocity)
