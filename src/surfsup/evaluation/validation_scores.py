"""How training chooses its checkpoints: a few short rollouts beside the truth, scored as they are made.

The full judgment, from trajectory files and beside the floor, is ``evaluate.py``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch

from surfsup.errors import InputError
from surfsup.evaluation.metrics import NO_CHAMFER, Chamfer, center_height, chamfer, kinetic_energy
from surfsup.evaluation.rollout import while_sound
from surfsup.evaluation.scores import ratio
from surfsup.io.trajectory import Trajectory
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import Environment


@dataclass(frozen=True)
class Scores:
    """Means over scenes of one model's rollouts.

    Attributes:
        chamfer: plain, meters, mean over frames.
        chamfer_squared: of squared distances, square meters.
        height_error: mean absolute error of the height of the center of mass, meters.
        energy_ratio: kinetic energy summed over the frames, predicted over true.
        inside: particles inside the solid, summed over frames and scenes.
        outside: particles outside the container, likewise.
        handle_collisions: share of particles that the guard moved in a frame.
    """

    chamfer: float
    chamfer_squared: float
    height_error: float
    energy_ratio: float
    inside: int
    outside: int
    handle_collisions: float

    @property
    def rank(self) -> float:
        """What checkpoints are chosen by, smaller is better: Chamfer, and how far energy and height are off."""
        if not math.isfinite(self.chamfer):
            return math.inf
        return self.chamfer + 0.2 * self.height_error + 0.02 * abs(math.log(max(self.energy_ratio, 1e-3)))


@torch.no_grad()
def rollout_scores(
    model: Simulator, truth: Trajectory, frames: int, every: int = 1, device: torch.device | str = "cpu"
) -> Scores:
    """Roll the model out from the start of ``truth`` and score its first frames.

    Args:
        model: the simulator.
        truth: what the reference solver made of the scene.
        frames: how many are scored; cut to those of ``truth``.
        every: Chamfer distances are taken at every so many-th frame; all else at each.
        device: where the model is.
    """
    surface = truth.scene.build_surface()
    environment = Environment.of(truth.scene, surface, device)
    frames = min(frames, len(truth))
    true_positions, true_velocities = truth.positions[:frames], truth.velocities[:frames]
    start = (torch.from_numpy(values[0]).to(device) for values in (true_positions, true_velocities))
    state = model.start(*start, environment)
    tally = Tally()
    for frame, (now, moved) in enumerate(while_sound(model.rollout(state, environment, frames))):
        positions, velocities = now.positions.cpu().numpy(), now.velocities.cpu().numpy()
        if frame % every == 0:
            tally.chamfer.append(chamfer(positions, true_positions[frame]))
        tally.height_error.append(abs(center_height(positions) - center_height(true_positions[frame])))
        tally.energy.append(kinetic_energy(velocities))
        tally.true_energy.append(kinetic_energy(true_velocities[frame]))
        tally.handle_collisions.append(float(moved.float().mean()))
        if surface is not None:
            tally.inside += int((environment.surface.distance(now.positions) < 0).sum())
        tally.outside += int(
            ((now.positions < environment.lower) | (now.positions > environment.upper)).any(dim=-1).sum()
        )
    if len(tally.energy) < frames:
        tally.chamfer.append(NO_CHAMFER)
    return tally.scores()


@dataclass
class Tally:
    """What is counted frame by frame."""

    chamfer: list[Chamfer] = field(default_factory=list)
    height_error: list[float] = field(default_factory=list)
    energy: list[float] = field(default_factory=list)
    true_energy: list[float] = field(default_factory=list)
    handle_collisions: list[float] = field(default_factory=list)
    inside: int = 0
    outside: int = 0

    def scores(self) -> Scores:
        """The scores of all frames so far."""
        return Scores(
            chamfer=float(np.mean([one.plain for one in self.chamfer])),
            chamfer_squared=float(np.mean([one.squared for one in self.chamfer])),
            height_error=float(np.mean(self.height_error)),
            energy_ratio=ratio(sum(self.energy), sum(self.true_energy)),
            inside=self.inside,
            outside=self.outside,
            handle_collisions=float(np.mean(self.handle_collisions)),
        )


def judge(
    model: Simulator, folder: Path, scenes: int, frames: int, device: torch.device | str = "cpu"
) -> Iterator[Scores]:
    """The scores of the first ``scenes`` trajectories of ``folder``, one by one; Chamfer at every fifth frame.

    The model is on ``device``.

    Raises:
        InputError: the folder has no trajectories.
    """
    for path in first_trajectories(folder, scenes):
        with Trajectory(path) as truth:
            yield rollout_scores(model, truth, frames, every=5, device=device)


def first_trajectories(folder: Path, count: int) -> list[Path]:
    """The first ``count`` trajectory files of ``folder``.

    Raises:
        InputError: there is none.
    """
    paths = sorted(folder.glob("*.h5"))[:count]
    if not paths:
        raise InputError(f"{folder}: has no trajectories (*.h5) to judge by; make some with 'surfsup generate'")
    return paths


def mean_scores(scores: list[Scores]) -> Scores:
    """Means of what is an average, sums of what is a count."""
    means = {name: float(np.mean([getattr(one, name) for one in scores])) for name in vars(scores[0])}
    counts = {name: sum(getattr(one, name) for one in scores) for name in ("inside", "outside")}
    return Scores(**{**means, **counts})
