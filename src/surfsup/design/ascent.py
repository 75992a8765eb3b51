"""Uphill by gradient: Adam, with gradients cut where they explode and every value kept in its range."""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import median

import torch
from torch import Tensor

from surfsup.design.parameter import Parameter, within

BETAS = (0.9, 0.99)
LAST_STEP = 0.05  # share of the first step's size that the last one has
LONGEST = 5.0  # times the usual length: a longer gradient is cut to that
REMEMBERED = 20  # lengths that tell what is usual


class Ascent:
    """The values of a design and how they climb.

    Adam (Kingma and Ba, 2015) with a step that falls by a cosine over all iterations: it needs no scale of the reward,
    which nobody knows beforehand. Each parameter counts in units of its own step.

    Attributes:
        values: now, by name; leaves that record gradients.
        iteration: how many steps were taken.
        cut: in how many iterations the gradient was shortened, or left out as not finite.
    """

    def __init__(self, parameters: Mapping[str, Parameter], values: Mapping[str, Tensor], iterations: int) -> None:
        self.parameters, self.iterations = parameters, iterations
        self.values = {name: value.clone().requires_grad_() for name, value in values.items()}
        self.mean = {name: torch.zeros_like(value) for name, value in values.items()}
        self.square = {name: torch.zeros_like(value) for name, value in values.items()}
        self.lengths: list[float] = []
        self.iteration = self.cut = 0

    def take(self, gradients: Mapping[str, Tensor]) -> float:
        """One step along ``gradients``; returns their length in units of reward a step, before any cut."""
        scaled = {name: gradients[name] * self.parameters[name].step for name in self.values}
        length = math.sqrt(sum(float(part.double().square().sum()) for part in scaled.values()))
        share = self.share_kept(length)
        self.iteration += 1
        rate = LAST_STEP + (1 - LAST_STEP) * (1 + math.cos(math.pi * (self.iteration - 1) / self.iterations)) / 2
        moved = {}
        for name, part in scaled.items():
            part = share * part if share else torch.zeros_like(part)
            self.mean[name] = BETAS[0] * self.mean[name] + (1 - BETAS[0]) * part
            self.square[name] = BETAS[1] * self.square[name] + (1 - BETAS[1]) * part.square()
            mean = self.mean[name] / (1 - BETAS[0] ** self.iteration)
            spread = (self.square[name] / (1 - BETAS[1] ** self.iteration)).sqrt()
            step = torch.where(spread > 0, mean / spread.clamp(min=torch.finfo(spread.dtype).tiny), 0.0)
            moved[name] = self.values[name].detach() + rate * self.parameters[name].step * step
        self.values = {
            name: kept(self.parameters[name], self.values[name].detach(), value).requires_grad_()
            for name, value in within(self.parameters, moved).items()
        }
        return length

    def share_kept(self, length: float) -> float:
        """How much of a gradient of that length is used; none of one that is not finite."""
        if not math.isfinite(length):
            self.cut += 1
            return 0.0
        usual = median(self.lengths[-REMEMBERED:]) if len(self.lengths) >= REMEMBERED // 2 else math.inf
        self.lengths.append(length)
        if length <= LONGEST * usual:
            return 1.0
        self.cut += 1
        return LONGEST * usual / length


def kept(parameter: Parameter, before: Tensor, after: Tensor) -> Tensor:
    """``after``, but where the parameter had reached the value that it keeps, that."""
    if parameter.keeps is None:
        return after
    return torch.where(before == parameter.keeps, before, after)
