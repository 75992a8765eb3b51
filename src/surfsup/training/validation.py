"""Rollouts of a run's averaged weights on validation scenes; they choose which weights are kept."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

from surfsup.datasets.units import check_units
from surfsup.evaluation.validation_scores import Scores, first_trajectories, judge, mean_scores
from surfsup.io.trajectory import Trajectory
from surfsup.learned import weights_file
from surfsup.training.run import Run


def check_validation(folder: Path, scenes: int) -> None:
    """Find out now, not at the first rollouts, that there is nothing to judge by.

    Raises:
        InputError: the folder has no trajectories, or one of the first ``scenes`` is none, or of another frame time or
            radius.
    """
    for path in first_trajectories(folder, scenes):
        with Trajectory(path) as trajectory:
            check_units(path, trajectory)


def keep_the_best(run: Run, validation: Path, loss: float, stop: Callable[[], bool]) -> Scores | None:
    """Roll out the averaged weights, log the scores, and keep the weights if they are the best so far.

    Returns None, and does nothing, where the run is to stop before all scenes are done.
    """
    config, every = run.config, []
    for one in judge(run.average, validation, config.judge_scenes, config.judge_frames, run.fabric.device):
        every.append(one)
        if stop():
            return None
    scores = mean_scores(every)
    write_row(run, loss, scores)
    if scores.rank < run.best:
        run.best = scores.rank
        about = f"step {run.step} of {config.model_dump_json()}; on validation scenes: {scores}"
        card = weights_file.Card(run.folder.name, about, run.seen)
        weights_file.save(run.folder / "best.safetensors", run.average, card)
    return scores


def write_row(run: Run, loss: float, scores: Scores) -> None:
    """Put the scores into ``log.csv``; rows of later steps are of what was lost and is being done again."""
    log = run.folder / "log.csv"
    rows: list[list[str]] = []
    if log.exists():
        with log.open(newline="") as file:
            rows = [row for row in list(csv.reader(file))[1:] if row and int(row[0]) < run.step]
    rows.append([f"{run.step}", f"{run.seconds:.0f}", f"{loss:.5f}", *(f"{v:.6g}" for v in vars(scores).values())])
    partial = log.with_suffix(".partial")
    with partial.open("w", newline="") as file:
        csv.writer(file).writerows([["step", "seconds", "loss", *vars(scores)], *rows])
    partial.replace(log)
