"""Scores of a few short rollouts, which select the checkpoints of a training run.

The full evaluation, from trajectory files and with the reproducibility floor, is in :mod:`surfsup.evaluation.evaluate`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from surfsup.evaluation.metrics import UNDEFINED_CHAMFER, center_height, chamfer, kinetic_energy
from surfsup.evaluation.rollout import environment_of, roll_out
from surfsup.evaluation.scores import energy_ratio
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_path import trajectory_files
from surfsup.sph.simulator import Simulator


@dataclass(frozen=True)
class ValidationScores:
    """Scores of a simulator's rollouts.

    Attributes:
        chamfer: of plain distances, meters, mean over frames and scenes.
        chamfer_squared: of squared distances, square meters, likewise.
        height_error: mean absolute error of the height of the center of mass, meters.
        energy_ratio: kinetic energy summed over the frames, predicted over reference.
        inside: particles inside the solid, summed over frames and scenes.
        outside: particles outside the container, likewise.
        collided_share: share of particles that collision handling moved, mean over frames.
    """

    chamfer: float
    chamfer_squared: float
    height_error: float
    energy_ratio: float
    inside: int
    outside: int
    collided_share: float

    @property
    def selection_error(self) -> float:
        """The error that selects checkpoints, smaller is better: Chamfer distance plus height and energy errors."""
        if not math.isfinite(self.chamfer):
            return math.inf
        return self.chamfer + 0.2 * self.height_error + 0.02 * abs(math.log(max(self.energy_ratio, 1e-3)))


@torch.no_grad()
def score_rollout(
    simulator: Simulator,
    reference: Trajectory,
    frames: int,
    chamfer_stride: int = 1,
    device: torch.device | str = "cpu",
    handle_collisions: bool = True,
) -> ValidationScores:
    """Simulate from the start of ``reference`` and score the first frames.

    Args:
        simulator: on ``device``.
        reference: the trajectory of the reference solver.
        frames: number of frames to score, at most those of ``reference``.
        chamfer_stride: frames from one Chamfer distance to the next; all else is computed in each frame.
        device: where to compute.
        handle_collisions: whether collision handling keeps particles out of the solid.
    """
    environment = environment_of(reference, device)
    frames = min(frames, len(reference))
    true_positions, true_velocities = reference.positions[:frames], reference.velocities[:frames]
    chamfers, height_errors, energies, true_energies, collided_shares = [], [], [], [], []
    inside = outside = 0
    rollout = roll_out(simulator, reference, environment, frames, handle_collisions)
    for frame, (state, collided) in enumerate(rollout):
        positions = state.positions.cpu().numpy()
        if frame % chamfer_stride == 0:
            chamfers.append(chamfer(positions, true_positions[frame]))
        height_errors.append(abs(center_height(positions) - center_height(true_positions[frame])))
        energies.append(kinetic_energy(state.velocities.cpu().numpy()))
        true_energies.append(kinetic_energy(true_velocities[frame]))
        collided_shares.append(float(collided.float().mean()))
        if environment.surface is not None:
            inside += int((environment.surface.distance(state.positions) < 0).sum())
        out_of_box = (state.positions < environment.lower) | (state.positions > environment.upper)
        outside += int(out_of_box.any(dim=-1).sum())
    if len(energies) < frames:  # diverged
        chamfers.append(UNDEFINED_CHAMFER)
    return ValidationScores(
        chamfer=float(np.mean([one.plain for one in chamfers])),
        chamfer_squared=float(np.mean([one.squared for one in chamfers])),
        height_error=float(np.mean(height_errors)),
        energy_ratio=energy_ratio(sum(energies), sum(true_energies)),
        inside=inside,
        outside=outside,
        collided_share=float(np.mean(collided_shares)),
    )


def score_rollouts(
    simulator: Simulator,
    folder: Path,
    scenes: int,
    frames: int,
    device: torch.device | str = "cpu",
    handle_collisions: bool = True,
) -> Iterator[ValidationScores]:
    """The scores of the first ``scenes`` trajectories of ``folder``, one by one; Chamfer at every fifth frame.

    The simulator is on ``device``.

    Raises:
        InputError: the folder has no trajectories.
    """
    for path in trajectory_files(folder)[:scenes]:
        with Trajectory(path) as reference:
            yield score_rollout(simulator, reference, frames, 5, device, handle_collisions)


def combine_scores(scores: list[ValidationScores]) -> ValidationScores:
    """Scores of several scenes as one: means of averages, sums of counts."""
    means = {name: float(np.mean([getattr(one, name) for one in scores])) for name in vars(scores[0])}
    counts = {name: sum(getattr(one, name) for one in scores) for name in ("inside", "outside")}
    return ValidationScores(**{**means, **counts})
