"""Baselines without gradients: CMA-ES and random search within the bounds of the parameters.

CMA-ES is Hansen's implementation (`cma` on PyPI) with its default population.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate, islice
from typing import Any

import numpy as np
import torch
from torch import Tensor

from surfsup.design.folder import write_text
from surfsup.design.history import process_cpu_seconds
from surfsup.design.parameter import Values, bounds, clamp_to_bounds, start_values
from surfsup.design.plots import plot_baselines
from surfsup.design.reward import NothingLanded
from surfsup.design.run import DesignRun
from surfsup.design.task import Task
from surfsup.design.verification import reference_reward
from surfsup.errors import InputError, SimulationError
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import ParticleState

INITIAL_SIGMA = 0.25  # of CMA-ES, relative to the bounds, as its author recommends
UNDEFINED = -1e6  # reward of a design whose reward is undefined
TARGETS = (0.05, 0.01, 0.001)  # distances from the best reward, relative to its gain over the first
REFERENCE_SEARCH = "CMA-ES on the reference solver"

Score = Callable[[Values], float]
Evaluations = Iterator[tuple[Values, float]]


def simulation_score(task: Task, simulator: Simulator[ParticleState]) -> Score:
    """The reward by our simulator, without gradient."""

    def score(values: Values) -> float:
        try:
            with torch.no_grad():
                return float(task.score(task.simulate(simulator, values, task.initial_state())))
        except (NothingLanded, SimulationError):
            return UNDEFINED

    return score


def reference_score(task: Task) -> Score:
    """The reward by the reference solver."""

    def score(values: Values) -> float:
        reward = reference_reward(task, values)
        return UNDEFINED if reward is None else reward

    return score


def cma_es(task: Task, score: Score, seed: int) -> Evaluations:
    """The designs that CMA-ES evaluates and their rewards, without end; it restarts when it has converged.

    Raises:
        InputError: the `cma` package is not installed.
    """
    try:
        import cma
    except ImportError:
        raise InputError("CMA-ES is not installed; install it with: pip install 'surfsup[design]'") from None
    cube = UnitCube(task)
    restart = 0
    while True:
        # The seed 0 would be the clock's.
        options = {"bounds": [0.0, 1.0], "seed": seed + 1 + restart, "verbose": -9}
        strategy = cma.CMAEvolutionStrategy(cube.to_point(start_values(task.parameters)), INITIAL_SIGMA, options)
        while not strategy.stop():
            points = strategy.ask()
            rewards = []
            for point in points:
                values = cube.to_values(point)
                rewards.append(score(values))
                yield values, rewards[-1]
            strategy.tell(points, [-reward for reward in rewards])
        restart += 1


def random_search(task: Task, score: Score, seed: int) -> Evaluations:
    """Designs drawn uniformly within the bounds and their rewards, without end."""
    cube, random = UnitCube(task), np.random.default_rng(seed)
    while True:
        values = cube.to_values(random.uniform(size=cube.dimensions))
        yield values, score(values)


def for_cpu_seconds(evaluations: Evaluations, seconds: float) -> list[tuple[Values, float]]:
    """Evaluations until this much CPU time is used, at least one."""
    end = process_cpu_seconds() + seconds
    found = [next(evaluations)]
    while process_cpu_seconds() < end:
        found.append(next(evaluations))
    return found


class UnitCube:
    """Maps the bounds of a task's parameters to the unit cube (D,). Points beyond dependent bounds are clamped.

    Attributes:
        dimensions: D.
    """

    def __init__(self, task: Task) -> None:
        self.parameters = task.parameters
        self.start = start_values(task.parameters)
        self.dimensions = sum(value.numel() for value in self.start.values())
        self.low: dict[str, Tensor] = {}
        self.high: dict[str, Tensor] = {}
        for name, parameter in task.parameters.items():
            # A bound that depends on other parameters is taken at their upper bounds, where it is widest here.
            low, high = bounds(parameter, self.high)
            self.low[name], self.high[name] = low.expand_as(self.start[name]), high.expand_as(self.start[name])

    def to_point(self, values: Values) -> np.ndarray:
        """Values as a point (D,) of the cube."""
        fractions = [(value - self.low[name]) / (self.high[name] - self.low[name]) for name, value in values.items()]
        return torch.cat([fraction.flatten() for fraction in fractions]).clamp(0, 1).double().numpy()

    def to_values(self, point: np.ndarray) -> dict[str, Tensor]:
        """The values of a point (D,) of the cube, clamped to their bounds."""
        numbers = torch.as_tensor(np.asarray(point), dtype=torch.float32)
        values: dict[str, Tensor] = {}
        for name, value in self.start.items():
            fractions, numbers = numbers[: value.numel()], numbers[value.numel() :]
            values[name] = self.low[name] + fractions.reshape(value.shape) * (self.high[name] - self.low[name])
        return clamp_to_bounds(self.parameters, values)


def compare_with_baselines(
    run: DesignRun, with_reference: bool, progress: Callable[[int, int], None] = lambda done, total: None
) -> str:
    """Run CMA-ES and random search with as many simulations as the run needed, including its finite differences.

    With the reference solver, CMA-ES also runs there, with as much CPU time as the run. ``baselines.json`` and
    ``baselines.png`` stay in the run's folder.

    Args:
        run: a finished run.
        with_reference: whether CMA-ES also runs on the reference solver.
        progress: called with the number of searches done and their total.

    Returns:
        A few lines for a terminal.

    Raises:
        InputError: the `cma` package is not installed.
    """
    task, count, score = run.task, run.simulations, simulation_score(run.task, run.simulator)
    searches: dict[str, Callable[[], list[tuple[Values, float]]]] = {
        "CMA-ES": lambda: list(islice(cma_es(task, score, run.seed), count)),
        "random search": lambda: list(islice(random_search(task, score, run.seed), count)),
    }
    if with_reference:
        searches[REFERENCE_SEARCH] = lambda: for_cpu_seconds(
            cma_es(task, reference_score(task), run.seed), run.cpu_seconds
        )
    best_so_far = {"gradient": best_by_simulation(run)}
    seconds, designs = {"gradient": run.cpu_seconds}, {}
    for done, (name, search) in enumerate(searches.items(), start=1):
        began = process_cpu_seconds()
        evaluations = search()
        seconds[name] = process_cpu_seconds() - began
        best_so_far[name] = list(accumulate((reward for _, reward in evaluations), max))
        values, _ = max(evaluations, key=lambda evaluation: evaluation[1])
        designs[name] = {key: value.tolist() for key, value in values.items()}
        progress(done, len(searches))
    comparable = {name: curve for name, curve in best_so_far.items() if name != REFERENCE_SEARCH}
    report: dict[str, Any] = {
        "best_so_far": best_so_far,
        "cpu_seconds": seconds,
        "designs": designs,
        "simulations_to_reach": simulations_to_reach(comparable, run.rewards[0]),
    }
    write_text(run.folder / "baselines.json", json.dumps(report, indent=2) + "\n")
    plot_baselines(comparable, f"{task.name}: rewards by the DFSPH solver", run.folder / "baselines.png")
    lines = [
        f"{name:<32}{curve[-1]:.6f}  {len(curve)} simulations, {seconds[name]:.0f} CPU seconds"
        for name, curve in best_so_far.items()
    ]
    lines += [
        f"{target:<32}after " + ", ".join(f"{name} {number or 'never'}" for name, number in numbers.items())
        for target, numbers in report["simulations_to_reach"].items()
    ]
    return "\n".join(lines)


def simulations_to_reach(best_so_far: dict[str, list[float]], first_reward: float) -> dict[str, dict[str, int | None]]:
    """For each target reward and each method the number of simulations to reach it; None if it never does."""
    top = max(curve[-1] for curve in best_so_far.values())
    targets = {f"within {fraction:.1%} of the best": top - fraction * (top - first_reward) for fraction in TARGETS}
    targets["the best of CMA-ES"] = best_so_far["CMA-ES"][-1]
    return {
        target: {name: first_index_reaching(curve, reward) for name, curve in best_so_far.items()}
        for target, reward in targets.items()
    }


def best_by_simulation(run: DesignRun) -> list[float]:
    """The best reward of the run after each of its simulations."""
    curve: list[float] = []
    for number, best in enumerate(accumulate(run.rewards, max)):
        is_last = number + 1 == len(run.rewards)
        until = run.simulations if is_last else run.simulations_at[number + 1] - 1
        curve += [best] * (until - len(curve))
    return curve


def first_index_reaching(best_so_far: Sequence[float], reward: float) -> int | None:
    """The number, from 1, of the first element that reaches ``reward``; None if none does."""
    return next((number for number, best in enumerate(best_so_far, start=1) if best >= reward), None)
