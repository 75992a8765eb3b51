"""Designs without gradients, to compare with: CMA-ES and random search.

CMA-ES is Hansen's (`cma` on PyPI), with its own default population. Both search the box of the parameters' ranges.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice

import numpy as np
import torch
from torch import Tensor

from surfsup.design.parameter import Values, bounds, starts, within
from surfsup.design.proof import true_reward
from surfsup.design.record import processor_seconds
from surfsup.design.reward import NothingLanded
from surfsup.design.task import Task
from surfsup.errors import InputError, SimulationError
from surfsup.learned.corrected.simulator import CorrectedSimulator

SPREAD = 0.25  # of each range: what CMA-ES begins with, as its author advises
WORST = -1e6  # reward of a design that has none

Score = Callable[[Values], float]


def by_model(task: Task, simulator: CorrectedSimulator) -> Score:
    """The reward of a design by the learned simulator, without gradient; the worst where there is none."""

    def score(values: Values) -> float:
        try:
            with torch.no_grad():
                return float(task.score(task.simulate(simulator, values, task.water())))
        except (NothingLanded, SimulationError):
            return WORST

    return score


def by_solver(task: Task) -> Score:
    """The reward of a design by the reference solver."""

    def score(values: Values) -> float:
        reward = true_reward(task, values)
        return WORST if reward is None else reward

    return score


def evolution(task: Task, score: Score, seed: int) -> Iterator[tuple[Values, float]]:
    """Designs and their rewards in the order in which CMA-ES asks for them, without end.

    Raises:
        InputError: the `cma` package is not installed.
    """
    try:
        import cma
    except ImportError:
        raise InputError("CMA-ES is not installed; install it with: pip install 'surfsup[design]'") from None
    box = Box(task)
    options = {"bounds": [0.0, 1.0], "seed": seed + 1, "verbose": -9}  # its seed 0 means the clock's
    while True:
        strategy = cma.CMAEvolutionStrategy(box.flat(starts(task.parameters)), SPREAD, options)
        while not strategy.stop():
            asked = strategy.ask()
            rewards = []
            for point in asked:
                values = box.values(point)
                rewards.append(score(values))
                yield values, rewards[-1]
            strategy.tell(asked, [-reward for reward in rewards])
        options["seed"] += 1  # converged: begin again elsewhere


def random_search(task: Task, score: Score, seed: int) -> Iterator[tuple[Values, float]]:
    """Designs drawn evenly from the ranges and their rewards, without end."""
    box, random = Box(task), np.random.default_rng(seed)
    while True:
        values = box.values(random.uniform(size=box.size))
        yield values, score(values)


def first(designs: Iterator[tuple[Values, float]], count: int) -> list[tuple[Values, float]]:
    """The first ``count`` designs."""
    return list(islice(designs, count))


def for_work(designs: Iterator[tuple[Values, float]], seconds: float) -> list[tuple[Values, float]]:
    """Designs until so many seconds of one processor are used up, one design at least."""
    end, found = processor_seconds() + seconds, []
    while not found or processor_seconds() < end:
        found.append(next(designs))
    return found


class Box:
    """The ranges of a task's parameters as the unit cube; what their bounds do not allow is moved into them."""

    def __init__(self, task: Task) -> None:
        self.parameters = task.parameters
        self.start = starts(task.parameters)
        self.size = sum(value.numel() for value in self.start.values())
        self.low: dict[str, Tensor] = {}
        self.high: dict[str, Tensor] = {}
        for name, parameter in task.parameters.items():
            # A bound that other parameters tell is widest where these are largest; so are those of the tasks here.
            low, high = bounds(parameter, self.high)
            self.low[name], self.high[name] = low.expand_as(self.start[name]), high.expand_as(self.start[name])

    def flat(self, values: Values) -> np.ndarray:
        """Values as a point (D,) of the cube."""
        shares = [(value - self.low[name]) / (self.high[name] - self.low[name]) for name, value in values.items()]
        return torch.cat([share.flatten() for share in shares]).clamp(0, 1).double().numpy()

    def values(self, point: np.ndarray) -> dict[str, Tensor]:
        """The values at a point (D,) of the cube, moved into their ranges."""
        numbers = torch.as_tensor(np.asarray(point), dtype=torch.float32)
        found: dict[str, Tensor] = {}
        for name, value in self.start.items():
            own, numbers = numbers[: value.numel()], numbers[value.numel() :]
            found[name] = self.low[name] + own.reshape(value.shape) * (self.high[name] - self.low[name])
        return within(self.parameters, found)
