"""The training loop: windows in, weights out; it stops when told and goes on where it stopped."""

from __future__ import annotations

import csv
import json
import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file, save_file

from surfsup.datasets.windows import Window, Windows
from surfsup.errors import InputError
from surfsup.evaluation.judge import Scores, judge
from surfsup.model import weights
from surfsup.model.convolution import Graph
from surfsup.model.guard import guard
from surfsup.model.simulator import Architecture, Correction, Observation, Simulator, join_observations
from surfsup.model.state import FRAME_TIME, State
from surfsup.training.config import Phase, TrainingConfig
from surfsup.training.loss import NEAR_SURFACE, energy_loss, motion_loss, wanted_correction

READ_AHEAD = 8  # batches that reading is ahead of the optimiser


@dataclass(frozen=True)
class Progress:
    """How a run stands, for whoever shows it.

    Attributes:
        step: steps done.
        steps: in all.
        loss: moving average of the last steps' loss.
        seconds_left: until the end at the present speed.
        scores: of the last rollouts, if there were any in this step.
    """

    step: int
    steps: int
    loss: float
    seconds_left: float
    scores: Scores | None


class NotANumber(RuntimeError):
    """The loss stopped being a number; the message says at which step."""


class Run:
    """One training run and its folder: configuration, checkpoint, log and the best weights so far."""

    def __init__(self, config: TrainingConfig, folder: Path) -> None:
        torch.manual_seed(config.seed)
        self.config, self.folder = config, folder
        self.model = Simulator(Architecture(config.width, config.layers, config.radius))
        self.average = deepcopy(self.model).requires_grad_(False)
        self.optimizer = torch.optim.Adam(self.model.parameters(), lr=config.learning_rate, fused=True)
        self.step = 0
        self.best = math.inf
        self.seconds = 0.0

    @property
    def checkpoint(self) -> Path:
        """The file from which the run can go on."""
        return self.folder / "checkpoint.safetensors"

    def save(self) -> None:
        """Write all that the run needs to go on, so that a kill at any moment leaves a whole file."""
        tensors = {f"model.{name}": value for name, value in self.model.state_dict().items()}
        tensors |= {f"average.{name}": value for name, value in self.average.state_dict().items()}
        for number, state in self.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{number}.{name}": value for name, value in state.items()}
        header = {"step": self.step, "best": self.best, "seconds": self.seconds}
        partial = self.checkpoint.with_suffix(".partial")
        save_file(
            {name: value.contiguous() for name, value in tensors.items()},
            partial,
            metadata={"run": json.dumps(header), "config": self.config.model_dump_json()},
        )
        partial.replace(self.checkpoint)

    def resume(self) -> None:
        """Go on from the checkpoint in the folder.

        Raises:
            InputError: there is none, it is cut off, or it belongs to another configuration.
        """
        from safetensors import SafetensorError, safe_open

        if not self.checkpoint.exists():
            raise InputError(f"{self.checkpoint}: there is no checkpoint to resume")
        try:
            with safe_open(self.checkpoint, framework="pt") as file:
                header = file.metadata()
            tensors = load_file(self.checkpoint)
        except SafetensorError as error:
            raise InputError(f"{self.checkpoint}: is cut off or damaged ({error})") from None
        if TrainingConfig.model_validate_json(header["config"]) != self.config:
            raise InputError(f"{self.checkpoint}: belongs to a run of another configuration; take a new folder")
        self.model.load_state_dict(part_of(tensors, "model."))
        self.average.load_state_dict(part_of(tensors, "average."))
        states: dict[int, dict[str, torch.Tensor]] = {}
        for name, value in part_of(tensors, "optimizer.").items():
            number, key = name.split(".", 1)
            states.setdefault(int(number), {})[key] = value
        groups = self.optimizer.state_dict()["param_groups"]
        self.optimizer.load_state_dict({"state": states, "param_groups": groups})
        counters = json.loads(header["run"])
        self.step, self.best, self.seconds = counters["step"], counters["best"], counters["seconds"]


def part_of(tensors: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    """The tensors whose name starts with ``prefix``, without it."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def train(
    run: Run,
    data: Path,
    validation: Path,
    until: float = math.inf,
    report: Callable[[Progress], None] | None = None,
) -> None:
    """Train until the configuration's steps are done or the time is up.

    Args:
        run: what to train; it may have been resumed.
        data: folder of training trajectories.
        validation: folder of trajectories that choose the checkpoint; never a test set.
        until: ``time.monotonic()`` value at which to stop with a checkpoint.
        report: told how it goes, every step.

    Raises:
        InputError: a folder has no trajectories.
        NotANumber: the loss became NaN; the checkpoint before it is kept.
    """
    config = run.config
    windows = Windows(data)
    run.folder.mkdir(parents=True, exist_ok=True)
    began, base, smoothed = time.monotonic(), run.seconds, math.nan
    first_step = run.step
    # Everything random in a step follows from its number, so a resumed run sees what an undisturbed one would.
    with ThreadPoolExecutor(1) as reader:
        ahead = {
            step: reader.submit(read_batch, windows, config, step)
            for step in range(run.step, min(run.step + READ_AHEAD, config.steps))
        }
        while run.step < config.steps and time.monotonic() < until:
            batch, random = ahead.pop(run.step).result()
            if run.step + READ_AHEAD < config.steps:
                ahead[run.step + READ_AHEAD] = reader.submit(read_batch, windows, config, run.step + READ_AHEAD)
            loss = take_step(run, batch, random)
            if not math.isfinite(loss):
                raise NotANumber(f"the loss is not a number at step {run.step}; {run.checkpoint} is from before")
            smoothed = loss if math.isnan(smoothed) else 0.99 * smoothed + 0.01 * loss
            run.step += 1
            run.seconds = base + time.monotonic() - began
            scores = None
            if run.step % config.judge_every == 0 or run.step == config.steps:
                scores = keep_the_best(run, validation, smoothed)
                run.save()
            if report is not None:
                speed = (time.monotonic() - began) / (run.step - first_step)
                report(Progress(run.step, config.steps, smoothed, speed * (config.steps - run.step), scores))
        for waiting in ahead.values():
            waiting.cancel()
    run.save()


def read_batch(windows: Windows, config: TrainingConfig, step: int) -> tuple[list[Window], np.random.Generator]:
    """The windows of ``step`` and the generator that the rest of the step draws from."""
    random = np.random.default_rng([config.seed, step])
    phase = config.phase(step)
    frames = phase.unroll + (int(random.integers(phase.unseen + 1)) if phase.unseen else 0)
    return [windows.draw(random, frames) for _ in range(config.batch)], random


def take_step(run: Run, batch: list[Window], random: np.random.Generator) -> float:
    """One step of the optimiser; returns the loss."""
    config = run.config
    for group in run.optimizer.param_groups:
        group["lr"] = learning_rate(config, run.step)
    loss = batch_loss(run.model, batch, config.phase(run.step), random)
    run.optimizer.zero_grad()
    loss.backward()
    torch.nn.utils.clip_grad_norm_(run.model.parameters(), 1.0)
    run.optimizer.step()
    # A young average would remember the random start for too long.
    decay = min(config.averaging, (1 + run.step) / (10 + run.step))
    with torch.no_grad():
        for kept, new in zip(run.average.parameters(), run.model.parameters(), strict=True):
            kept.lerp_(new, 1 - decay)
    return float(loss.detach())


def learning_rate(config: TrainingConfig, step: int) -> float:
    """A short rise, then a cosine from the first to the final rate."""
    if step < config.warm_up:
        return config.learning_rate * (step + 1) / config.warm_up
    share = (step - config.warm_up) / max(1, config.steps - config.warm_up)
    low, high = config.final_learning_rate, config.learning_rate
    return low + 0.5 * (high - low) * (1 + math.cos(math.pi * share))


def batch_loss(
    model: Simulator, batch: list[Window], phase: Phase, random: np.random.Generator
) -> torch.Tensor:
    """The loss of a batch of windows of equal length: frames without gradient first, then those that count."""
    frames = len(batch[0].positions)
    states = [with_noise(window.state, phase.noise, random) for window in batch]
    with torch.no_grad():
        for _ in range(frames - phase.unroll):
            states = [model.step(state, window.around)[0] for state, window in zip(states, batch, strict=True)]
    losses = []
    for frame in range(frames - phase.unroll, frames):
        seen = [
            with_fixed_graph(model.observe(state, window.around))
            for state, window in zip(states, batch, strict=True)
        ]
        predicted = split(model.correct(join_observations(seen)), seen)
        following = []
        for window, view, correction in zip(batch, seen, predicted, strict=True):
            positions, velocities = model.advance(view, correction)
            true_positions, true_velocities = window.positions[frame], window.velocities[frame]
            wanted = wanted_correction(view, true_positions, true_velocities)
            with torch.no_grad():
                near = window.around.distance_and_normal(view.ahead)[0] < NEAR_SURFACE
            losses.append(motion_loss(correction, wanted, near))
            if phase.energy > 0:
                shift = torch.from_numpy(random.uniform(0, 1, 3).astype(np.float32))
                size = wanted.velocity.square().sum(dim=-1).mean().sqrt()
                losses[-1] = losses[-1] + phase.energy / (1 + size) * energy_loss(
                    velocities, true_velocities, true_positions, shift
                )
            kept = guard(view.state.positions, positions, velocities, window.around)
            following.append(view.state.moved_to(kept.positions, kept.velocities))
        states = following
    return torch.stack(losses).mean()


def with_fixed_graph(seen: Observation) -> Observation:
    """The observation with its kernels taken as given.

    Their gradient would be passed back to the frame before, where it says little and costs as much as all the rest.
    """
    return replace(seen, graph=Graph(seen.graph.neighbourhood, seen.graph.kernels.detach()))


def split(joined: Correction, parts: list[Observation]) -> list[Correction]:
    """The correction of several scenes side by side, scene by scene."""
    sizes = [len(part.ahead) for part in parts]
    pairs = zip(joined.velocity.split(sizes), joined.position.split(sizes), strict=True)
    return [Correction(*pair) for pair in pairs]


def with_noise(state: State, noise: float, random: np.random.Generator) -> State:
    """A state a little off, as the model's own would be; the targets stay the truth, so that it learns to return."""
    if noise == 0:
        return state

    def draw(scale: float) -> torch.Tensor:
        return torch.from_numpy(random.normal(0, scale, state.positions.shape).astype(np.float32))

    return State(
        state.positions + draw(noise),
        state.velocities + draw(noise / FRAME_TIME),
        state.displacement + draw(noise),
        state.velocity_change + draw(noise / FRAME_TIME),
    )


def keep_the_best(run: Run, validation: Path, loss: float) -> Scores:
    """Roll out the averaged weights, log the scores, and keep the weights if they are the best so far."""
    config = run.config
    scores = judge(run.average, validation, config.judge_scenes, config.judge_frames)
    log = run.folder / "log.csv"
    new = not log.exists()
    with log.open("a", newline="") as file:
        writer = csv.writer(file)
        if new:
            writer.writerow(["step", "seconds", "loss", *vars(scores)])
        writer.writerow([run.step, f"{run.seconds:.0f}", f"{loss:.5f}", *(f"{v:.6g}" for v in vars(scores).values())])
    if scores.rank < run.best:
        run.best = scores.rank
        about = f"step {run.step} of {config.model_dump_json()}; on validation scenes: {scores}"
        weights.save(run.folder / "best.safetensors", run.average, weights.Card(run.folder.name, about))
    return scores
