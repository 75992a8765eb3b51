"""The numbers of an evaluation as plain data, for ``report.json`` and the report's page."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from surfsup import __version__
from surfsup.errors import InputError
from surfsup.evaluation.compare import Comparison
from surfsup.evaluation.domain_warnings import domain_warnings
from surfsup.evaluation.evaluate import EvaluatedScene, Evaluation
from surfsup.evaluation.floor import FLOOR_HINT
from surfsup.evaluation.load_trajectories import DataSet, SkippedFile
from surfsup.evaluation.scores import METRICS, WINDOWS, WindowScores, floor_ratios
from surfsup.evaluation.summary import summaries
from surfsup.io.atomic_file import atomic_file
from surfsup.learned.weights_file import Card

DIGITS = 6  # significant digits of a curve's values

CHAMFERS = ("chamfer", "chamfer_squared", "surface", "surface_squared")  # curves of a comparison
STATISTICS = ("height", "energy", "inside", "near", "lost", "density")  # curves of each trajectory by itself

Json = dict[str, Any]


@dataclass(frozen=True)
class EvaluationSettings:
    """What is evaluated and how.

    Attributes:
        name: of the simulator.
        card: of its weights; None for a simulator without weights.
        handle_collisions: whether collision handling was on.
        threshold: meters; particles closer to the solid count for Chamfer Surface.
        scenes: maximum number of scenes of each data set; None for all.
        frames: maximum number of frames of each scene; None for all.
    """

    name: str
    card: Card | None
    handle_collisions: bool
    threshold: float
    scenes: int | None = None
    frames: int | None = None


def make_folder(path: Path) -> None:
    """Make the folder of the report.

    Raises:
        InputError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made ({error.strerror}); give another folder with -o") from None


def evaluation_report(
    settings: EvaluationSettings,
    sets: Sequence[DataSet],
    scenes: Sequence[EvaluatedScene],
    skipped: Sequence[SkippedFile],
    folder: Path,
) -> Json:
    """The whole evaluation as plain data for JSON.

    Args:
        settings: what was evaluated and how.
        sets: the data sets.
        scenes: the evaluated scenes.
        skipped: files that were not valid.
        folder: of the report; trajectories are named relative to it.
    """
    card = settings.card
    warnings = domain_warnings(card.training_domain if card else None, [scene.reference for scene in scenes])
    return {
        "simulator": {
            "name": settings.name,
            "about": card.about if card else "",
            "handle_collisions": settings.handle_collisions,
        },
        "limits": {"scenes": settings.scenes, "frames": settings.frames},
        **definitions(settings.threshold, scenes[0].reference.scene.frame_time),
        "data": [{**data_set_entry(one, scenes, skipped), "domain_warning": warnings.get(one.name)} for one in sets],
        "means": [
            {
                "data": mean.data_set,
                "surface": mean.surface,
                "scenes": mean.scenes,
                "floors": mean.floors,
                "windows": score_entries(mean.scores, mean.floor, mean.ratio),
            }
            for mean in summaries(scenes)
        ],
        "scenes": [
            {
                "data": scene.reference.data_set,
                "scene": scene.name,
                "trajectory": scene.rollout.relative_to(folder).as_posix(),
                "collided_share": scene.collided_share,
                **evaluation_entry(scene.evaluation),
            }
            for scene in scenes
        ],
    }


def definitions(threshold: float, frame_time: float) -> Json:
    """The meaning of a report's numbers."""
    return {
        "version": __version__,
        "frame_time": frame_time,
        "near": threshold,
        "metrics": [
            {name: getattr(metric, name) for name in ("key", "name", "unit", "decimals", "description")}
            for metric in METRICS
        ],
        "windows": [window.name for window in WINDOWS],
    }


def data_set_entry(one: DataSet, scenes: Sequence[EvaluatedScene], skipped: Sequence[SkippedFile]) -> Json:
    """A data set: how many of its files were evaluated, and which were skipped."""
    members = [scene for scene in scenes if scene.reference.data_set == one.name]
    floors = sum(bool(scene.evaluation.floor_comparisons) for scene in members)
    own_skipped = [bad for bad in skipped if bad.file.is_relative_to(one.folder)]
    return {
        "name": one.name,
        "files": len(one.paths),
        "scenes": len(members),
        "floors": floors,
        "floor_missing": None if floors == len(members) else FLOOR_HINT.format(one.folder),
        "skipped": [{"file": bad.file.relative_to(one.folder).as_posix(), "reason": bad.reason} for bad in own_skipped],
    }


def evaluation_entry(evaluation: Evaluation) -> Json:
    """One scene: its scores by window, and its curves frame by frame."""
    ratio = floor_ratios(evaluation.scores, evaluation.floor)
    return {
        "surface": evaluation.surface,
        "particles": evaluation.particles,
        "frames": len(evaluation.comparison),
        "repeats": len(evaluation.floor_comparisons),
        "reached_solid": evaluation.reached_solid,
        "windows": score_entries(evaluation.scores, evaluation.floor, ratio),
        "curves": curves(evaluation.comparison, evaluation.floor_comparisons),
    }


def score_entries(scores: WindowScores, floor: WindowScores, ratio: WindowScores) -> Json:
    """Window -> metric -> prediction, floor and ratio."""
    return {
        window: {
            key: {"prediction": value, "floor": floor.get(window, {}).get(key), "ratio": ratio.get(window, {}).get(key)}
            for key, value in values.items()
        }
        for window, values in scores.items()
    }


def curves(comparison: Comparison, floors: Sequence[Comparison]) -> Json:
    """Quantity -> curves (frames,) of prediction, floor (mean of the repeats) and, for statistics, reference."""
    chamfers = {
        name: {
            "prediction": json_values(getattr(comparison, name)),
            "floor": mean_curve([getattr(one, name) for one in floors]),
        }
        for name in CHAMFERS
    }
    statistics = {
        name: {
            "prediction": json_values(getattr(comparison.prediction, name)),
            "reference": json_values(getattr(comparison.reference, name)),
            "floor": mean_curve([getattr(one.prediction, name) for one in floors]),
        }
        for name in STATISTICS
    }
    return {**chamfers, **statistics}


def mean_curve(repeats: Sequence[np.ndarray]) -> list[float | None] | None:
    """The mean of the repeats' curves; None without repeats."""
    return json_values(np.mean(repeats, axis=0)) if repeats else None


def json_values(values: np.ndarray) -> list[float | None]:
    """Rounded values for JSON; None for values that are not finite."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values]


def write_json(path: Path, report: Json) -> None:
    """Write ``report``.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        with atomic_file(path) as partial:
            partial.write_text(json.dumps(report, allow_nan=False, separators=(",", ":")) + "\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
