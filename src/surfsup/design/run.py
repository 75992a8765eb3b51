"""A design run: evaluate the current design, and take a step uphill."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from surfsup.design.exploration import explore, is_due
from surfsup.design.gradient_check import GradientCheck
from surfsup.design.history import MIN_IMPROVEMENT, DesignHistory
from surfsup.design.optimizer import Optimizer
from surfsup.design.parameter import start_values
from surfsup.design.rollout import GradientNotFinite
from surfsup.design.task import Task, format_values
from surfsup.errors import InputError, SimulationError
from surfsup.optim.checkpoint import CheckpointFiles
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState

FREQUENT_CLIPPING = 0.1  # fraction of iterations with a clipped gradient from which a remedy is suggested


class DesignRun(DesignHistory):
    """One optimization of a task by gradients through the DFSPH solver.

    Attributes:
        task: what is designed.
        folder: where the run is saved.
        simulator: the solver.
        optimizer: the current design.
        gradient_check: the reliability of the gradients.
        broken_gradients: why a step was skipped, for each of this process whose gradient was not finite.
    """

    def __init__(self, task: Task, folder: Path, iterations: int = 100, smoothing: float = 0.0, seed: int = 0) -> None:
        """A run before its first iteration.

        Args:
            task: what to design.
            folder: where to save the run.
            iterations: maximum number of steps.
            smoothing: meters by which the fluid's start is shifted at random in each iteration; it smooths a rough
                reward.
            seed: of the random shifts and directions.

        Raises:
            InputError: a start value is out of bounds.
        """
        super().__init__()
        self.task, self.folder, self.smoothing, self.seed = task, folder, smoothing, seed
        self.simulator = DfsphSolver()
        self.start = start_values(task.parameters)
        self.optimizer = Optimizer(task.parameters, self.start, iterations)
        self.gradient_check = GradientCheck()
        self.broken_gradients: list[str] = []
        self.files = CheckpointFiles(folder)

    @property
    def done(self) -> bool:
        """Whether all iterations are done and the last design is evaluated, or the run has converged."""
        return len(self.rewards) > self.optimizer.iterations or self.converged

    def iterate(self) -> None:
        """Evaluate the current design and take a step; after the last step only evaluate.

        Raises:
            InputError: the reward is not finite or does not depend on the shape, or the shape intersects the fluid's
                start or the container.
            SimulationError: the simulation diverged.
        """
        state = self.task.initial_state(self.shift())
        values = self.optimizer.values
        if self.optimizer.iteration == self.optimizer.iterations:
            with torch.no_grad():
                reward = self.task.score(self.task.simulate(self.simulator, values, state))
            self.append(reward, values)
            return
        reward = self.task.score(self.task.simulate(self.simulator, values, state))
        gradient = self.optimizer.space.gradient_vector(self.gradients(reward))
        self.append(reward, values)
        current, total_gain, known_step = self.rewards[-1], max(self.rewards) - self.rewards[0], None
        reliable = self.gradient_check.compare(self.optimizer, gradient, current, total_gain)
        if self.gradient_check.unreliable:
            random = np.random.default_rng([self.seed, self.optimizer.iteration, 1])
            score = self.score_without_gradient(state)
            measured = self.gradient_check.measure(self.optimizer, gradient, current, score, random)
            gradient, known_step, reliable = measured.gradient, measured.step_to_maximum, True
        self.optimizer.step(gradient, reliable, known_step)
        if is_due(self.rewards):
            self.explore(self.score_without_gradient(state))

    def explore(self, score: Callable[[Tensor], float | None]) -> None:
        """Continue from elsewhere in the range if a design there is better than all so far."""
        space = self.optimizer.space
        best = space.to_vector(self.designs[self.best])
        found = explore(space, best, score, [self.seed, self.optimizer.iteration, 2])
        needed = MIN_IMPROVEMENT * (max(self.rewards) - self.rewards[0])
        if found is not None and found[1] > max(self.rewards) + needed:
            self.optimizer.jump_to(found[0])
            self.gradient_check.forget()

    def score_without_gradient(self, state: ParticleState) -> Callable[[Tensor], float | None]:
        """The reward as a function of the parameter vector (P,); None where it is undefined. It counts simulations."""

        def score(vector: Tensor) -> float | None:
            self.simulations += 1
            values = self.optimizer.space.to_values(vector)
            try:
                with torch.no_grad():
                    return float(self.task.score(self.task.simulate(self.simulator, values, state)))
            except (InputError, SimulationError):
                return None

        return score

    def gradients(self, reward: Tensor) -> dict[str, Tensor]:
        """The gradients of the reward with respect to the values, by name.

        Raises:
            InputError: at the start the reward depends on none of them.
        """
        values = self.optimizer.values
        found: tuple[Tensor | None, ...] = (None,) * len(values)
        if reward.requires_grad:
            try:
                found = torch.autograd.grad(reward, list(values.values()), allow_unused=True)
            except GradientNotFinite as error:  # the optimizer skips the step
                self.broken_gradients.append(str(error))
                found = tuple(torch.full_like(value, torch.nan) for value in values.values())
        gradients = {
            name: torch.zeros_like(value) if gradient is None else gradient
            for (name, value), gradient in zip(values.items(), found, strict=True)
        }
        if not self.rewards and not any(bool(gradient.any()) for gradient in gradients.values()):
            raise InputError(
                f"{self.task.name}: the reward does not depend on {', '.join(values)} at {format_values(values)}: no "
                "water that the reward counts meets the shape; move the shape or the water, or use more frames"
            )
        return gradients

    def shift(self) -> tuple[float, float]:
        """The shift of the fluid's start in this iteration, meters."""
        if not self.smoothing or self.optimizer.iteration == self.optimizer.iterations:
            return 0.0, 0.0
        random = np.random.default_rng([self.seed, self.optimizer.iteration])
        x, y = random.uniform(-self.smoothing, self.smoothing, 2)
        return float(x), float(y)

    def remedy(self) -> str | None:
        """What to try if gradients were not finite, or clipped often; None if they were not."""
        if self.broken_gradients:
            return (
                f"{len(self.broken_gradients)} of {len(self.rewards)} steps were skipped: {self.broken_gradients[-1]}"
            )
        if self.optimizer.clipped <= FREQUENT_CLIPPING * len(self.rewards):
            return None
        return (
            f"the gradient exploded and was clipped in {self.optimizer.clipped} of {len(self.rewards)} iterations; "
            "fewer --frames make it smaller, and so does --smooth 0.005, which shifts the water's start at random"
        )

    @property
    def config(self) -> dict[str, Any]:
        """What identifies the run, for JSON."""
        return {
            "task": self.task.name,
            "start": {name: value.tolist() for name, value in self.start.items()},
            "scene": self.task.scene.to_yaml(),
            "frames": self.task.scene.frames - 1,
            "iterations": self.optimizer.iterations,
            "smoothing": self.smoothing,
            "seed": self.seed,
        }
