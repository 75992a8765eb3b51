"""Validation: rollouts of the averaged weights, whose scores decide which weights are kept."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

from surfsup.datasets.units import check_units
from surfsup.evaluation.validation_scores import ValidationScores, combine_scores, score_rollouts
from surfsup.io.atomic_file import atomic_file
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_path import trajectory_files
from surfsup.learned import weights_file
from surfsup.training.run import TrainingRun


def check_validation(folder: Path, scenes: int) -> None:
    """Check the first ``scenes`` trajectories of ``folder`` before training, not at the first validation.

    Raises:
        InputError: the folder has no trajectories, or one of them cannot be read or has another frame time or radius.
    """
    for path in trajectory_files(folder)[:scenes]:
        with Trajectory(path) as trajectory:
            check_units(path, trajectory)


def keep_best(run: TrainingRun, folder: Path, stop: Callable[[], bool]) -> ValidationScores | None:
    """Roll out the averaged weights, log the scores, and save the weights if they are the best so far.

    Returns None, and saves nothing, if ``stop`` returns True after a scene.
    """
    config, scores_of_scenes = run.config, []
    for one in score_rollouts(
        run.average,
        folder,
        config.validation_scenes,
        config.validation_frames,
        run.fabric.device,
        config.validation_collisions,
    ):
        scores_of_scenes.append(one)
        if stop():
            return None
    scores = combine_scores(scores_of_scenes)
    log_scores(run, scores)
    if scores.selection_error < run.best_score:
        run.best_score = scores.selection_error
        about = f"step {run.step} of {config.model_dump_json()}; on validation scenes: {scores}"
        card = weights_file.Card(run.folder.name, about, run.training_domain)
        weights_file.save(run.folder / "best.safetensors", run.average, card)
    return scores


def log_scores(run: TrainingRun, scores: ValidationScores) -> None:
    """Add a row to ``log.csv``; drop rows of later steps, which were lost and are now repeated."""
    log = run.folder / "log.csv"
    rows: list[list[str]] = []
    if log.exists():
        with log.open(newline="") as file:
            rows = [row for row in list(csv.reader(file))[1:] if row and int(row[0]) < run.step]
    values = [f"{value:.6g}" for value in vars(scores).values()]
    rows.append([f"{run.step}", f"{run.seconds:.0f}", f"{run.smoothed_loss:.5f}", *values])
    with atomic_file(log) as partial, partial.open("w", newline="") as file:
        csv.writer(file).writerows([["step", "seconds", "loss", *vars(scores)], *rows])
