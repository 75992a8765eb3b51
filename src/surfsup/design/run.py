"""A design run: looking at the design as it is, and taking a step uphill."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from surfsup.design.ascent import Ascent
from surfsup.design.parameter import starts
from surfsup.design.record import Record
from surfsup.design.reward import Outcome
from surfsup.design.rollout import Water
from surfsup.design.task import Task, told
from surfsup.design.trust import Trust
from surfsup.errors import InputError, SimulationError
from surfsup.learned.corrected.simulator import CorrectedSimulator
from surfsup.optim.checkpoint import CheckpointFiles

OFTEN = 0.1  # share of iterations with a cut gradient from which a remedy is offered


class DesignRun(Record):
    """One design run, with what it has looked at.

    Attributes:
        task: what is designed.
        simulator, model: that tells where the water goes, and its name.
        ascent: the design now.
        trust: what the gradients have been worth.
    """

    def __init__(
        self,
        task: Task,
        folder: Path,
        simulator: CorrectedSimulator,
        model: str,
        iterations: int = 100,
        smoothing: float | None = None,
        seed: int = 0,
    ) -> None:
        """A run that has not begun.

        Args:
            task: what to design.
            folder: where it is kept.
            simulator: the learned simulator.
            model: its name.
            iterations: steps uphill.
            smoothing: meters by which the water's start is moved aside at random in each iteration; None leaves it to
                the task.
            seed: of those moves.

        Raises:
            InputError: a start is outside its range, or the simulator is of a kind without gradients here.
        """
        if not isinstance(simulator, CorrectedSimulator):
            raise InputError(
                f"the model '{model}' is of kind '{simulator.kind}'; a design needs one of kind '{CorrectedSimulator.kind}'"
            )
        super().__init__()
        self.task, self.folder, self.simulator, self.model = task, folder, simulator, model
        self.smoothing = task.smoothing if smoothing is None else smoothing
        self.seed = seed
        self.start = starts(task.parameters)
        self.ascent = Ascent(task.parameters, self.start, iterations)
        self.trust = Trust()
        self.files = CheckpointFiles(folder)

    @property
    def done(self) -> bool:
        """Whether every iteration was taken and the last design looked at, or nothing is gained any more."""
        return len(self.rewards) > self.ascent.iterations or self.settled

    def iterate(self) -> None:
        """Look at the design as it is, and take a step uphill; after the last step only look."""
        water = self.task.water(self.shift())
        values = self.ascent.values
        if self.ascent.iteration == self.ascent.iterations:
            with torch.no_grad():
                reward = self.task.score(self.task.simulate(self.simulator, values, water))
            self.note(reward, values)
            return
        reward = self.task.score(self.task.simulate(self.simulator, values, water))
        slope = self.ascent.coordinates.slope(self.gradients(reward))
        self.note(reward, values)
        reward_now, gained, leap = self.rewards[-1], max(self.rewards) - self.rewards[0], None
        reliable = self.trust.weigh(self.ascent, slope, reward_now, gained)
        if self.trust.doubted:
            random = np.random.default_rng([self.seed, self.ascent.iteration, 1])
            told_by = self.trust.measured(self.ascent, slope, reward_now, self.plain_reward(water), random)
            slope, leap, reliable = told_by.slope, told_by.leap, True
        self.ascent.take(slope, reliable, leap)

    def plain_reward(self, water: Water) -> Callable[[Tensor], float | None]:
        """The reward at a place of the ascent, by a rollout without a way back; each one counts as a simulation."""

        def score(place: Tensor) -> float | None:
            self.simulations += 1
            values = self.ascent.coordinates.values(place)
            try:
                with torch.no_grad():
                    return float(self.task.score(self.task.simulate(self.simulator, values, water)))
            except (InputError, SimulationError):
                return None

        return score

    def gradients(self, reward: Tensor) -> dict[str, Tensor]:
        """Of the reward in every value.

        Raises:
            InputError: at the start it does not depend on any.
        """
        values = self.ascent.values
        found: tuple[Tensor | None, ...] = (None,) * len(values)
        if reward.requires_grad:
            found = torch.autograd.grad(reward, list(values.values()), allow_unused=True)
        gradients = {
            name: torch.zeros_like(value) if gradient is None else gradient
            for (name, value), gradient in zip(values.items(), found, strict=True)
        }
        if not self.rewards and not any(bool(gradient.any()) for gradient in gradients.values()):
            raise InputError(
                f"{self.task.name}: the reward does not depend on {', '.join(values)} at {told(values)}: no water that "
                "counts meets the shape; move the shape or the water, or give more frames"
            )
        return gradients

    def shift(self) -> tuple[float, float]:
        """How far the water's start is moved aside in this iteration, meters."""
        if not self.smoothing or self.ascent.iteration == self.ascent.iterations:
            return 0.0, 0.0
        x, y = np.random.default_rng([self.seed, self.ascent.iteration]).uniform(-self.smoothing, self.smoothing, 2)
        return float(x), float(y)

    def outcome(self, number: int) -> Outcome:
        """The water's end in design ``number``, simulated again."""
        with torch.no_grad():
            return self.task.simulate(self.simulator, self.designs[number], self.task.water())

    def remedy(self) -> str | None:
        """What to try where gradients exploded often; None where they did not."""
        if self.ascent.cut <= OFTEN * len(self.rewards):
            return None
        return (
            f"the gradient exploded and was cut in {self.ascent.cut} of {len(self.rewards)} iterations; fewer --frames "
            "make it tamer, and so does --smooth 0.005, which moves the water's start a little in every iteration"
        )

    @property
    def config(self) -> dict[str, Any]:
        """What makes it this run and no other, fit for JSON."""
        return {
            "task": self.task.name,
            "start": {name: value.tolist() for name, value in self.start.items()},
            "scene": self.task.scene.to_yaml(),
            "frames": self.task.scene.frames - 1,
            "iterations": self.ascent.iterations,
            "model": self.model,
            "smoothing": self.smoothing,
            "seed": self.seed,
        }
