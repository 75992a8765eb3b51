"""Uphill by gradient: Adam that lands on a top instead of swinging over it, with every value kept in its range."""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import median

import torch
from torch import Tensor

from surfsup.design.coordinates import Coordinates
from surfsup.design.parameter import Parameter

BETAS = (0.9, 0.99)
LAST_STEP = 0.05  # share of the first step's size that the last one has
LONGEST = 5.0  # times the usual length: a longer gradient is cut to that
REMEMBERED = 20  # lengths that tell what is usual
CAREFUL = 0.3  # weight that an average begins with where a number landed: its next steps are short
NEGLIGIBLE = 0.02  # of a number's usual slope: its sign says nothing of where a top is


class Ascent:
    """The values of a design and how they climb.

    Adam (Kingma and Ba, 2015) with a step that falls by a cosine over all iterations: it needs no scale of the reward,
    which nobody knows beforehand. Where the slopes of half of the numbers or more have turned since the last step, and
    gradients are to be relied on, these go to where a straight line between both slopes has its zero (the secant), and
    their averages begin anew: Adam alone would swing over the top for many iterations. Few that turn among many are
    the roughness of the ground.

    Attributes:
        coordinates: that the vectors of this class are in: steps of the parameters, and reward a step.
        values: now, by name; leaves that record gradients.
        iteration: how many steps were taken.
        cut: in how many iterations the gradient was shortened, or left out as not finite.
        memory: of all steps so far, by name, each (P,): Adam's averages of slopes and of their squares, the weight
            that the first has gathered, the last slope and the last move.
    """

    def __init__(self, parameters: Mapping[str, Parameter], values: Mapping[str, Tensor], iterations: int) -> None:
        self.parameters, self.iterations = parameters, iterations
        self.coordinates = Coordinates(parameters, values)
        self.values = {name: value.clone().requires_grad_() for name, value in values.items()}
        names = ("mean", "square", "weight", "slope", "move")
        self.memory = {name: torch.zeros_like(self.coordinates.steps) for name in names}
        self.lengths: list[float] = []
        self.iteration = self.cut = 0

    @property
    def place(self) -> Tensor:
        """Where the values are, (P,)."""
        return self.coordinates.place(self.values)

    @property
    def free(self) -> Tensor:
        """Which numbers (P,) may still change."""
        return ~self.coordinates.keeping(self.values)

    def usual(self, slope: Tensor) -> Tensor:
        """The root mean square (P,) of the slopes so far and of this one."""
        square = BETAS[1] * self.memory["square"] + (1 - BETAS[1]) * slope.square()
        return (square / (1 - BETAS[1] ** (self.iteration + 1))).sqrt()

    def take(self, slope: Tensor, reliable: bool = True, leap: Tensor | None = None) -> None:
        """One step along ``slope`` (P,), in reward a step.

        Args:
            slope: the gradient.
            reliable: whether slopes so far held what they promised, so that a secant between two may be trusted.
            leap: (P,) in steps: a way to the top that is known otherwise; it is taken instead.
        """
        slope = self.share_kept(float(slope.double().norm())) * torch.nan_to_num(slope, 0.0, 0.0, 0.0)
        memory, before, usual = self.memory, self.place, self.usual(slope)
        rate = LAST_STEP + (1 - LAST_STEP) * (1 + math.cos(math.pi * self.iteration / self.iterations)) / 2
        self.iteration += 1
        mean = BETAS[0] * memory["mean"] + (1 - BETAS[0]) * slope
        weight = BETAS[0] * memory["weight"] + (1 - BETAS[0])
        move = rate * torch.where(usual > 0, mean / weight / usual.clamp(min=torch.finfo(usual.dtype).tiny), 0.0)
        turned = (memory["slope"] * slope < 0) & (memory["slope"] * memory["move"] > 0)
        turned &= slope.abs() > NEGLIGIBLE * usual
        lands = turned & (reliable and bool(2 * turned.sum() >= self.free.sum()))
        secant = -memory["move"] * slope.abs() / (slope.abs() + memory["slope"].abs()).clamp(min=1e-30)
        move = torch.where(lands, secant, move)
        if leap is not None:
            lands, move = self.free, leap
        self.values = {
            name: kept(self.parameters[name], self.values[name].detach(), value).requires_grad_()
            for name, value in self.coordinates.values(before + move).items()
        }
        self.memory = {
            "mean": torch.where(lands, 0.0, mean),
            "square": BETAS[1] * memory["square"] + (1 - BETAS[1]) * slope.square(),
            "weight": torch.where(lands, CAREFUL, weight),
            "slope": slope,
            "move": self.place - before,
        }

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
    """``after``, but the value that the parameter keeps where it had reached that, or reaches it now."""
    if parameter.keeps is None:
        return after
    reached = (before == parameter.keeps) | ((after - parameter.keeps).abs() <= parameter.reach)
    return torch.where(reached, parameter.keeps, after)
