"""One step of training: a batch of windows, its loss, the optimiser."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import torch

from surfsup.datasets.windows import Window
from surfsup.model.convolution import Graph
from surfsup.model.guard import guard
from surfsup.model.simulator import POSITION_SHARE, Correction, Observation, Simulator, join_observations
from surfsup.model.state import FRAME_TIME, State
from surfsup.training.config import Phase, TrainingConfig
from surfsup.training.loss import NEAR_SURFACE, energy_loss, motion_loss, wanted_correction
from surfsup.training.run import Run

NOISE_DECADES = 2.0  # how many powers of ten smaller than the configured noise a window's may be


def take_step(run: Run, batch: list[Window], random: np.random.Generator) -> float:
    """One step of the optimiser; returns the loss, NaN where it or its gradient is not finite.

    A step that is not a number leaves the weights as they were.
    """
    config = run.config
    for group in run.optimizer.param_groups:
        group["lr"] = learning_rate(config, run.step)
    loss = batch_loss(run.model, batch, config.phase(run.step), random)
    run.optimizer.zero_grad()
    loss.backward()
    norm = torch.nn.utils.clip_grad_norm_(run.model.parameters(), 1.0)
    if not bool(torch.isfinite(loss.detach()) & torch.isfinite(norm)):
        return math.nan
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


def batch_loss(model: Simulator, batch: list[Window], phase: Phase, random: np.random.Generator) -> torch.Tensor:
    """The loss of a batch of windows of equal length: first frames without gradient, then those that count."""
    frames = len(batch[0].positions)
    states = [with_noise(window.state, phase.noise, random) for window in batch]
    with torch.no_grad():
        for _ in range(frames - phase.unroll):
            states = [model.step(state, window.around)[0] for state, window in zip(states, batch, strict=True)]
    losses = []
    for frame in range(frames - phase.unroll, frames):
        seen = [
            with_fixed_graph(model.observe(state, window.around)) for state, window in zip(states, batch, strict=True)
        ]
        predicted = split(model.correct(join_observations(seen)), seen)
        following = []
        for window, view, correction in zip(batch, seen, predicted, strict=True):
            positions, velocities = model.advance(view, correction)
            true_positions, true_velocities = window.positions[frame], window.velocities[frame]
            before = window.positions[frame - 1] if frame > 0 else window.state.positions
            wanted = wanted_correction(view, before, true_positions, true_velocities)
            with torch.no_grad():
                near = window.around.distance_and_normal(view.ahead)[0] < NEAR_SURFACE
            losses.append(motion_loss(correction, wanted, near))
            if phase.energy > 0:
                shift = torch.from_numpy(random.uniform(0, 1, 3).astype(np.float32))
                size = wanted.velocity.detach().square().sum(dim=-1).mean().sqrt()
                losses[-1] = losses[-1] + phase.energy / (1 + size) * energy_loss(
                    velocities, true_velocities, true_positions, shift
                )
            kept = guard(view.state.positions, positions, velocities, window.around)
            following.append(view.state.moved_to(kept.positions, kept.velocities))
        states = following
    return torch.stack(losses).mean()


def with_fixed_graph(seen: Observation) -> Observation:
    """The observation with its kernels taken as given.

    Their gradient would be passed back to the frame before, where it says little and costs as much as all
    the rest.
    """
    return replace(seen, graph=Graph(seen.graph.neighbourhood, seen.graph.kernels.detach()))


def split(joined: Correction, parts: list[Observation]) -> list[Correction]:
    """The correction of several scenes side by side, scene by scene."""
    sizes = [len(part.ahead) for part in parts]
    pairs = zip(joined.velocity.split(sizes), joined.position.split(sizes), strict=True)
    return [Correction(*pair) for pair in pairs]


def with_noise(state: State, noise: float, random: np.random.Generator) -> State:
    """A state as the model itself would have left it, were the frame before still exact.

    The errors of place and of velocity go together as the model's do, and show in the last frame's displacement and
    change of velocity: noise that did not would teach answers that feed back on themselves in a rollout. Its size is
    drawn anew for every window, from almost nothing on, so that a calm state stays calm.
    """
    if noise == 0:
        return state
    size = noise * 10 ** random.uniform(-NOISE_DECADES, 0)

    def draw() -> torch.Tensor:
        return torch.from_numpy(random.normal(0, size, state.positions.shape).astype(np.float32))

    in_velocity = draw() / FRAME_TIME
    in_place = POSITION_SHARE * FRAME_TIME * in_velocity + 0.5 * draw()
    return State(
        state.positions + in_place,
        state.velocities + in_velocity,
        state.displacement + in_place,
        state.velocity_change + in_velocity,
    )
