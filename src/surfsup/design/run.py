"""A design run and its folder: what it needs to stop at any moment and go on as if it had not."""

from __future__ import annotations

import csv
import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from surfsup.design.ascent import Ascent
from surfsup.design.parameter import Values, starts
from surfsup.design.reward import Outcome
from surfsup.design.rollout import Water
from surfsup.design.task import Task, told
from surfsup.design.trust import Trust
from surfsup.errors import InputError, SimulationError
from surfsup.model.simulator import Simulator
from surfsup.training.checkpoint import Checkpoint, CheckpointFiles
from surfsup.training.run import part_of

SECONDS_A_SAVE = 5.0
PATIENCE = 25  # iterations without gain after which a run ends
HARDLY = 1e-3  # of all that was gained: less is no gain
OFTEN = 0.1  # share of iterations with a cut gradient from which a remedy is offered


@dataclass(frozen=True)
class Progress:
    """Where a run is.

    Attributes:
        iteration, iterations: done, and how many there will be.
        reward: of the last design that was looked at.
        values: the design now, in words.
        seconds_left: until the last iteration, at the pace so far.
    """

    iteration: int
    iterations: int
    reward: float
    values: str
    seconds_left: float


class DesignRun:
    """One design run and its folder.

    Attributes:
        task: what is designed.
        simulator, model: that tells where the water goes, and its name.
        ascent: the design now.
        rewards: of every design looked at, the start first; after the last iteration that of the last design too.
        designs: their values by name, one dictionary a design.
        trust: what the gradients have been worth.
        simulations: so far, those by which slopes were measured among them.
        found_after: how many there had been when each design was looked at.
        seconds: of computing.
        work: of one processor, in seconds.
    """

    def __init__(
        self,
        task: Task,
        folder: Path,
        simulator: Simulator,
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
            smoothing: metres by which the water's start is moved aside at random in each iteration; None leaves it to
                the task.
            seed: of those moves.

        Raises:
            InputError: a start is outside its range, or the simulator is of a kind without gradients here.
        """
        if not isinstance(simulator, Simulator):
            raise InputError(
                f"the model '{model}' is of kind '{simulator.kind}'; a design needs one of kind '{Simulator.kind}'"
            )
        self.task, self.folder, self.simulator, self.model = task, folder, simulator, model
        self.smoothing = task.smoothing if smoothing is None else smoothing
        self.seed = seed
        self.start = starts(task.parameters)
        self.ascent = Ascent(task.parameters, self.start, iterations)
        self.trust = Trust()
        self.rewards: list[float] = []
        self.designs: list[dict[str, Tensor]] = []
        self.found_after: list[int] = []
        self.simulations = 0
        self.seconds = self.work = 0.0
        self.files = CheckpointFiles(folder)

    @property
    def done(self) -> bool:
        """Whether every iteration was taken and the last design looked at, or nothing is gained any more."""
        return len(self.rewards) > self.ascent.iterations or self.settled

    @property
    def settled(self) -> bool:
        """Whether the last iterations brought the best reward forward by no share worth mentioning."""
        if len(self.rewards) <= PATIENCE:
            return False
        best = max(self.rewards)
        return best - max(self.rewards[:-PATIENCE]) <= HARDLY * (best - self.rewards[0])

    @property
    def best(self) -> int:
        """The number of the design with the best reward."""
        return int(np.argmax(self.rewards))

    def climb(self, stop: Callable[[], bool], tell: Callable[[Progress], None]) -> None:
        """Iterate until all is done or ``stop`` says so; whatever happens, what was found is kept.

        Raises:
            InputError: the reward is no number or does not depend on the shape, the shape is in the water's way or
                leaves the container, nothing lands where that is asked for.
            SimulationError: the simulation blew up.
        """
        saved = time.monotonic()
        try:
            while not self.done and not stop():
                began, worked = time.monotonic(), processor_seconds()
                self.iterate()
                self.seconds += time.monotonic() - began
                self.work += processor_seconds() - worked
                left = self.seconds / len(self.rewards) * (self.ascent.iterations + 1 - len(self.rewards))
                now = told(self.ascent.values)
                tell(Progress(self.ascent.iteration, self.ascent.iterations, self.rewards[-1], now, left))
                if time.monotonic() - saved > SECONDS_A_SAVE:
                    self.save()
                    saved = time.monotonic()
        except (InputError, SimulationError) as error:
            if not self.rewards:
                raise
            raise type(error)(
                f"{error} (iteration {self.ascent.iteration}; the best design so far is kept in {self.folder})"
            ) from None
        finally:
            if self.rewards:
                self.save()

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

    def note(self, reward: Tensor, values: Values) -> None:
        """Keep a design and its reward, and after how many simulations it was found."""
        self.simulations += 1
        self.found_after.append(self.simulations)
        self.designs.append({name: value.detach().clone() for name, value in values.items()})
        self.rewards.append(float(reward.detach()))

    def shift(self) -> tuple[float, float]:
        """How far the water's start is moved aside in this iteration, metres."""
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

    def config(self) -> str:
        """What makes it this run and no other, as JSON."""
        scene = self.task.scene
        return json.dumps(
            {
                "task": self.task.name,
                "start": {name: value.tolist() for name, value in self.start.items()},
                "scene": scene.to_yaml(),
                "frames": scene.frames - 1,
                "iterations": self.ascent.iterations,
                "model": self.model,
                "smoothing": self.smoothing,
                "seed": self.seed,
            }
        )

    def save(self) -> None:
        """Write all that the run needs to go on, and ``design.json`` and ``history.csv`` for whoever reads.

        Raises:
            InputError: the disk is full or not writable.
        """
        ascent, tensors = self.ascent, {}
        tensors |= {f"values.{name}": value.detach() for name, value in ascent.values.items()}
        tensors |= {f"ascent.{name}": value for name, value in ascent.memory.items()}
        tensors |= {f"trust.{name}": value for name, value in self.trust.memory.items()}
        for name in self.start:
            tensors[f"designs.{name}"] = torch.stack([design[name] for design in self.designs])
        tensors["rewards"] = torch.tensor(self.rewards, dtype=torch.float64)
        tensors["lengths"] = torch.tensor(ascent.lengths, dtype=torch.float64)
        tensors["found_after"] = torch.tensor(self.found_after)
        counters = {
            "iteration": ascent.iteration,
            "cut": ascent.cut,
            "doubted": int(self.trust.doubted),
            "broken": self.trust.broken,
            "simulations": self.simulations,
            "seconds": self.seconds,
            "work": self.work,
        }
        self.files.save(Checkpoint(tensors, counters, self.config()))
        self.write_summary()

    def write_summary(self) -> None:
        """``design.json``: start, best and last design; ``history.csv``: a row for each design looked at."""
        summary = {
            **json.loads(self.config()),
            "iterations_done": self.ascent.iteration,
            "simulations": self.simulations,
            "settled": self.settled,
            "seconds": round(self.seconds, 1),
            "processor_seconds": round(self.work, 1),
            "gradients_cut": self.ascent.cut,
            "designs": {
                label: {
                    "iteration": number,
                    "reward": self.rewards[number],
                    **{name: value.tolist() for name, value in self.designs[number].items()},
                }
                for label, number in (("start", 0), ("best", self.best), ("last", len(self.designs) - 1))
            },
        }
        write_whole(self.folder / "design.json", json.dumps(summary, indent=2) + "\n")
        names = [f"{name}{part}" for name, value in self.start.items() for part in parts_of(value)]
        partial = self.folder / ".history.csv.partial"
        with partial.open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["iteration", "reward", *names])
            for number, (reward, design) in enumerate(zip(self.rewards, self.designs, strict=True)):
                flat = torch.cat([value.flatten() for value in design.values()])
                rows.writerow([number, f"{reward:.7g}", *(f"{value:.7g}" for value in flat.tolist())])
        os.replace(partial, self.folder / "history.csv")

    def resume(self) -> None:
        """Go on from the checkpoint in the folder.

        Raises:
            InputError: there is none, it is cut off, or it belongs to another design.
        """
        checkpoint = self.files.load()
        if checkpoint.config != self.config():
            raise InputError(
                f"{self.files.last}: belongs to a design with other settings; give the same as before, or a new folder"
            )
        try:
            tensors, counters, ascent = checkpoint.tensors, checkpoint.counters, self.ascent
            ascent.values = {name: value.requires_grad_() for name, value in part_of(tensors, "values.").items()}
            ascent.values = {name: ascent.values[name] for name in self.start}
            ascent.memory = {name: tensors[f"ascent.{name}"] for name in ascent.memory}
            self.trust.memory = part_of(tensors, "trust.")
            self.trust.doubted, self.trust.broken = bool(counters["doubted"]), counters["broken"]
            ascent.iteration, ascent.cut = counters["iteration"], counters["cut"]
            ascent.lengths, self.rewards = tensors["lengths"].tolist(), tensors["rewards"].tolist()
            self.found_after, self.simulations = tensors["found_after"].tolist(), counters["simulations"]
            columns = part_of(tensors, "designs.")
            self.designs = [{name: columns[name][number] for name in self.start} for number in range(len(self.rewards))]
            self.seconds, self.work = counters["seconds"], counters["work"]
        except (KeyError, IndexError) as error:
            raise InputError(f"{self.files.last}: is no checkpoint of this version ({error})") from None


def processor_seconds() -> float:
    """What this process and its children that have ended took of the processors so far."""
    return sum(os.times()[:4])


def parts_of(value: Tensor) -> list[str]:
    """What comes behind a parameter's name to tell its numbers apart."""
    return [""] if value.ndim == 0 else [f".{number}" for number in range(value.numel())]


def write_whole(path: Path, text: str) -> None:
    """Write ``text`` to ``path``, which appears under its name only when it is whole."""
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(text, encoding="utf-8")
    partial.replace(path)
