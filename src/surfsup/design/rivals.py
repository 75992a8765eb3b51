"""Designs without gradients, to compare with: CMA-ES and random search.

CMA-ES is Hansen's (`cma` on PyPI), with its own default population. Both search the box of the parameters' ranges.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import islice

import numpy as np
import torch
from torch import Tensor

from surfsup.design.parameter import Values, bounds, starts, within
from surfsup.design.proof import true_reward
from surfsup.design.reward import NothingLanded
from surfsup.design.task import Task
from surfsup.errors import InputError, SimulationError
from surfsup.model.simulator import Simulator

SPREAD = 0.25  # of each range: what CMA-ES begins with, as its author advises
WORST = -1e6  # reward of a design that has none

Score = Callable[[Values], float]


def by_model(task: Task, simulator: Simulator) -> Score:
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


def for_seconds(designs: Iterator[tuple[Values, float]], seconds: float) -> list[tuple[Values, float]]:
    """Designs until the time is up, one at least."""
    end, found = time.monotonic() + seconds, []
    while not found or time.monotonic() < end:
        found.append(next(designs))
    return found


class Box:
    """The ranges of a task's parameters as the unit cube."""

    def __init__(self, task: Task) -> None:
        self.parameters = task.parameters
        self.start = starts(task.parameters)
        self.size = sum(value.numel() for value in self.start.values())
        ranges = {name: bounds(parameter, self.start) for name, parameter in task.parameters.items()}
        # The widest range that a bound of other parameters' telling can give is not known; it is cut to as it is asked.
        self.low = {name: float(low) for name, (low, _) in ranges.items()}
        self.high = {name: float(high) for name, (_, high) in self.widest(ranges).items()}

    def widest(self, ranges: dict[str, tuple[Tensor, Tensor]]) -> dict[str, tuple[Tensor, Tensor]]:
        """The ranges where each parameter is at the top of its own."""
        top: dict[str, Tensor] = {}
        for name, parameter in self.parameters.items():
            low, high = bounds(parameter, top)
            top[name] = high.expand_as(self.start[name])
            ranges = {**ranges, name: (low, high)}
        return ranges

    def flat(self, values: Values) -> np.ndarray:
        """Values as a point (D,) of the cube."""
        parts = [
            (value.double().flatten().numpy() - self.low[name]) / (self.high[name] - self.low[name])
            for name, value in values.items()
        ]
        return np.clip(np.concatenate(parts), 0, 1)

    def values(self, point: np.ndarray) -> dict[str, Tensor]:
        """The values at a point (D,) of the cube, moved into their ranges."""
        found, first_number = {}, 0
        for name, value in self.start.items():
            part = np.asarray(point[first_number : first_number + value.numel()])
            first_number += value.numel()
            scaled = self.low[name] + part * (self.high[name] - self.low[name])
            found[name] = torch.as_tensor(scaled, dtype=torch.float32).reshape(value.shape)
        return within(self.parameters, found)
