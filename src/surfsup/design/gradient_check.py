"""Checks gradients against rewards, and replaces unreliable ones by finite differences.

A gradient follows each particle along its path. It does not include that a particle beside the rim of a funnel would
fall to the other side if the rim were a little wider. Where many particles are near such a decision, the reward can
rise where the gradient says that it falls; and on a rough reward a gradient can be zero by chance.

A rollout without gradient costs a sixteenth of one with gradient. Therefore, while the gradient is unreliable, slopes
along two directions are measured by finite differences over about a step length, and replace the gradient's component
in their plane. With two parameters that is the whole gradient. The rest of the gradient stays, as a control variate
(compare guided evolution strategies, Maheswaranathan et al. 2019).

If the rewards along every direction have a maximum nearby, the step goes to the maximum of the quadratic fits. If the
optimizer stalls, the distance of the finite differences doubles each time: a local maximum narrower than a step length
is not where to stop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from surfsup.design.optimizer import Optimizer
from surfsup.design.parameter_space import ParameterSpace

TOLERANCE = 0.5  # relative difference between predicted and actual improvement, or between slopes, that is a failure
MAX_FAILURES = 2  # failures in a row from which gradients are unreliable
MIN_CHANGE = 0.02  # relative to the total gain so far: a smaller difference is not a failure
MIN_PREDICTION = 0.1  # relative to the usual one: a gradient that predicts less improvement is unreliable
MIN_DISTANCE = 0.1  # step lengths: over less no slope is measured, because the reward is rough
MAX_DISTANCE = 4.0  # step lengths of the finite differences of a stalled optimizer

Score = Callable[[Tensor], float | None]


class GradientCheck:
    """The reliability of the gradients of a design run.

    Attributes:
        unreliable: whether gradients are replaced by finite differences.
        failures: failed predictions in a row.
        stalls: measurements in a row before which the optimizer had hardly moved.
        previous: of the iteration before, by name: ``reward`` (), ``gradient`` (P,), ``vector`` (P,); empty at first.
    """

    def __init__(self) -> None:
        self.unreliable, self.failures, self.stalls = False, 0, 0
        self.previous: dict[str, Tensor] = {}

    def compare(self, optimizer: Optimizer, gradient: Tensor, reward: float, total_gain: float) -> bool:
        """Compare the actual improvement of the last step with the one that the gradients at both its ends predict.

        Args:
            optimizer: with the current values.
            gradient: (P,) at these values, reward per step length.
            reward: at these values.
            total_gain: of the best reward over the first.

        Returns:
            Whether they agree. Afterwards ``unreliable`` is also set if the gradient predicts hardly any improvement
            within the bounds.
        """
        agrees, vector = True, optimizer.vector
        if self.previous:
            actual = reward - float(self.previous["reward"])
            predicted = float((self.previous["gradient"] + gradient) @ (vector - self.previous["vector"])) / 2
            allowed = max(TOLERANCE * max(abs(actual), abs(predicted)), MIN_CHANGE * total_gain)
            agrees = abs(actual - predicted) <= allowed
        self.failures = 0 if agrees else self.failures + 1
        uphill = optimizer.space.clamp(vector + gradient.sign() * optimizer.free) - vector
        usual = float(optimizer.rms_slope(gradient) @ optimizer.free.float())
        flat = float(gradient @ uphill) < MIN_PREDICTION * usual
        self.unreliable = self.unreliable or flat or self.failures >= MAX_FAILURES
        self.previous = {
            "reward": torch.tensor(reward, dtype=torch.float64),
            "gradient": gradient,
            "vector": vector,
        }
        return agrees

    def forget(self) -> None:
        """Expect nothing of the next design: the search has jumped."""
        self.previous, self.failures, self.stalls = {}, 0, 0

    def measure(
        self, optimizer: Optimizer, gradient: Tensor, reward: float, score: Score, random: np.random.Generator
    ) -> MeasuredGradient:
        """The gradient with its component along two directions measured by finite differences.

        Afterwards ``unreliable`` is False if the measurement confirms the gradient.

        Args:
            optimizer: with the current values.
            gradient: (P,) at these values, reward per step length.
            reward: at these values.
            score: the reward at a vector (P,), None where it is undefined.
            random: of the second direction; the first is uphill.
        """
        vector, free = optimizer.vector, optimizer.free
        last_step = optimizer.state["step"].abs()
        self.stalls = self.stalls + 1 if optimizer.iteration and float(last_step.max()) < MIN_DISTANCE else 0
        distance = torch.where(last_step == 0, 1.0, last_step.clamp(MIN_DISTANCE, 1.0))
        distance = (distance * 2.0**self.stalls).clamp(max=MAX_DISTANCE) * free
        first = torch.where(gradient == 0, 1.0, gradient.sign()) * distance
        second = torch.from_numpy(random.standard_normal(len(distance))).to(distance) * distance
        second = second - (second @ first) / (first @ first).clamp(min=1e-30) * first
        offsets = (first, second * first.norm() / second.norm().clamp(min=1e-30))
        lines = [
            line
            for offset in offsets[: int(free.sum())]
            if (line := sample_line(optimizer.space, vector, reward, offset, score)) is not None
        ]
        if not lines:
            return MeasuredGradient(gradient, None)
        directions = torch.stack([line.direction for line in lines], dim=1)
        slopes = torch.tensor([line.slope for line in lines])
        error = slopes - directions.T @ gradient
        self.unreliable = float(error.norm()) >= TOLERANCE * float(slopes.norm())
        maxima = [line.maximum for line in lines if line.maximum is not None]
        step = directions @ torch.tensor(maxima) if len(maxima) == int(free.sum()) else None
        return MeasuredGradient(gradient + directions @ torch.linalg.pinv(directions.T @ directions) @ error, step)


@dataclass(frozen=True)
class MeasuredGradient:
    """The result of finite differences.

    Attributes:
        gradient: (P,), reward per step length.
        step_to_maximum: (P,) in step lengths; None unless the rewards along every direction have a maximum nearby.
    """

    gradient: Tensor
    step_to_maximum: Tensor | None


@dataclass(frozen=True)
class LineSamples:
    """Rewards along a line.

    Attributes:
        direction: (P,), of length 1.
        slope: along it, reward per step length.
        maximum: position on the line of the maximum of the quadratic through three rewards; None if it has none, or
            one beyond the samples.
    """

    direction: Tensor
    slope: float
    maximum: float | None


def sample_line(
    space: ParameterSpace, vector: Tensor, reward: float, offset: Tensor, score: Score
) -> LineSamples | None:
    """Sample the reward at ``vector`` ± ``offset`` (P,), clamped to the bounds; None if neither sample is possible."""
    ends = []
    for end in (space.clamp(vector + offset), space.clamp(vector - offset)):
        found = score(end) if bool((end - vector).norm() > MIN_DISTANCE / 2) else None
        ends.append((vector, reward) if found is None else (end, found))
    (ahead, reward_ahead), (behind, reward_behind) = ends
    length = float((ahead - behind).norm())
    if length == 0:
        return None
    slope, half, maximum = (reward_ahead - reward_behind) / length, length / 2, None
    curvature = (reward_ahead + reward_behind - 2 * reward) / half**2
    symmetric = bool(torch.allclose(ahead + behind, 2 * vector, atol=1e-4))
    if symmetric and curvature < 0 and abs(slope) < -curvature * half:
        maximum = -slope / curvature
    return LineSamples((ahead - behind) / length, slope, maximum)
