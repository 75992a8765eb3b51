"""The optimizer of a design: Adam with secant steps, for maximization within bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import median

import torch
from torch import Tensor

from surfsup.design.parameter import Parameter
from surfsup.design.parameter_space import ParameterSpace

BETAS = (0.9, 0.99)
FINAL_RATE = 0.05  # of the last step, relative to the first
CLIP_RATIO = 5.0  # a gradient longer than this many usual lengths is clipped to it
NORM_HISTORY = 20  # gradients that define the usual length
RESTART_WEIGHT = 0.3  # initial weight of an average after a secant step, which keeps the next steps short
NEGLIGIBLE = 0.02  # relative to the usual slope: the sign of a smaller one is not used


class Optimizer:
    """The values of a design and the steps that maximize its reward.

    Adam (Kingma and Ba, 2015) with a cosine schedule: its step length does not depend on the scale of the reward, which
    is unknown. Adam alone oscillates around a maximum for many iterations. Therefore, if gradients are reliable and at
    least half of the slopes have changed sign since the last step, those parameters take a secant step to the zero of
    the slope, and their averages restart. If only a few of many slopes change sign, the reward is rough, and they do
    not.

    Attributes:
        space: the vectors of this class are in its units: step lengths, and reward per step length.
        values: current values by name, leaf tensors that require gradients.
        iteration: number of steps so far.
        clipped: number of iterations in which the gradient was clipped, or skipped because it was not finite.
        state: by name, each (P,): Adam's averages of slopes (``mean``) and of their squares (``square``), the weight
            accumulated in ``mean`` (``weight``), the last slope (``gradient``) and the last step (``step``).
    """

    def __init__(self, parameters: Mapping[str, Parameter], values: Mapping[str, Tensor], iterations: int) -> None:
        self.parameters, self.iterations = parameters, iterations
        self.space = ParameterSpace(parameters, values)
        self.values = {name: value.clone().requires_grad_() for name, value in values.items()}
        names = ("mean", "square", "weight", "gradient", "step")
        self.state = {name: torch.zeros_like(self.space.step_lengths) for name in names}
        self.gradient_norms: list[float] = []
        self.iteration = self.clipped = 0

    @property
    def vector(self) -> Tensor:
        """The current values as a vector (P,)."""
        return self.space.to_vector(self.values)

    @property
    def free(self) -> Tensor:
        """Which elements (P,) are not frozen."""
        return ~self.space.frozen(self.values)

    def rms_slope(self, gradient: Tensor) -> Tensor:
        """The root mean square (P,) of the slopes so far and of ``gradient``."""
        square = BETAS[1] * self.state["square"] + (1 - BETAS[1]) * gradient.square()
        return (square / (1 - BETAS[1] ** (self.iteration + 1))).sqrt()

    def step(self, gradient: Tensor, reliable: bool = True, known_step: Tensor | None = None) -> None:
        """Take one step uphill.

        Args:
            gradient: (P,), reward per step length.
            reliable: whether the gradients so far have predicted the reward, so that secant steps are allowed.
            known_step: (P,) in step lengths, a step to the maximum found by other means; it is taken instead.
        """
        gradient = self.clip_factor(float(gradient.double().norm())) * torch.nan_to_num(gradient, 0.0, 0.0, 0.0)
        state, before, rms = self.state, self.vector, self.rms_slope(gradient)
        rate = FINAL_RATE + (1 - FINAL_RATE) * (1 + math.cos(math.pi * self.iteration / self.iterations)) / 2
        self.iteration += 1
        mean = BETAS[0] * state["mean"] + (1 - BETAS[0]) * gradient
        weight = BETAS[0] * state["weight"] + (1 - BETAS[0])
        step = rate * torch.where(rms > 0, mean / weight / rms.clamp(min=torch.finfo(rms.dtype).tiny), 0.0)
        sign_change = (state["gradient"] * gradient < 0) & (state["gradient"] * state["step"] > 0)
        sign_change &= gradient.abs() > NEGLIGIBLE * rms
        restart = sign_change & (reliable and bool(2 * sign_change.sum() >= self.free.sum()))
        secant = -state["step"] * gradient.abs() / (gradient.abs() + state["gradient"].abs()).clamp(min=1e-30)
        step = torch.where(restart, secant, step)
        if known_step is not None:
            restart, step = self.free, known_step
        self.values = {
            name: freeze(self.parameters[name], self.values[name].detach(), value).requires_grad_()
            for name, value in self.space.to_values(before + step).items()
        }
        self.state = {
            "mean": torch.where(restart, 0.0, mean),
            "square": BETAS[1] * state["square"] + (1 - BETAS[1]) * gradient.square(),
            "weight": torch.where(restart, RESTART_WEIGHT, weight),
            "gradient": gradient,
            "step": self.vector - before,
        }

    def jump_to(self, vector: Tensor) -> None:
        """Continue from another design (P,). The usual slope stays, the direction is forgotten."""
        self.values = {
            name: freeze(self.parameters[name], self.values[name].detach(), value).requires_grad_()
            for name, value in self.space.to_values(vector).items()
        }
        forgotten = ("mean", "weight", "gradient", "step")
        self.state |= {name: torch.zeros_like(self.state[name]) for name in forgotten}

    def clip_factor(self, norm: float) -> float:
        """The factor that clips a gradient of this norm; 0 if it is not finite."""
        if not math.isfinite(norm):
            self.clipped += 1
            return 0.0
        history = self.gradient_norms[-NORM_HISTORY:]
        usual = median(history) if len(history) >= NORM_HISTORY // 2 else math.inf
        self.gradient_norms.append(norm)
        if norm <= CLIP_RATIO * usual:
            return 1.0
        self.clipped += 1
        return CLIP_RATIO * usual / norm


def freeze(parameter: Parameter, before: Tensor, after: Tensor) -> Tensor:
    """``after``, with all elements at ``freeze_at`` that were there before or have reached it now."""
    if parameter.freeze_at is None:
        return after
    reached = (before == parameter.freeze_at) | ((after - parameter.freeze_at).abs() <= parameter.freeze_tolerance)
    return torch.where(reached, parameter.freeze_at, after)
