"""The report folder: every number in ``report.json``, beside the rollouts themselves."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup import __version__
from surfsup.errors import InputError
from surfsup.evaluation.compare import Comparison
from surfsup.evaluation.evaluate import JudgedScene, Judgment
from surfsup.evaluation.floor import HOW_TO_MAKE
from surfsup.evaluation.load_trajectories import DataSet, Skipped
from surfsup.evaluation.scores import METRICS, WINDOWS, ByWindow, ratios
from surfsup.evaluation.summary import summaries
from surfsup.evaluation.unseen import unseen
from surfsup.learned.weights_file import Card
from surfsup.scene import FRAME_TIME

DIGITS = 6  # of a curve's values; more are noise

CHAMFERS = ("chamfer", "chamfer_squared", "surface", "surface_squared")  # of two trajectories
COURSES = ("height", "energy", "inside", "near", "lost", "density")  # of each by itself


@dataclass(frozen=True)
class Subject:
    """What is judged and how.

    Attributes:
        card: the model's.
        handle_collisions: whether the guard against penetration was on.
        threshold: meters; particles nearer to the solid count for Chamfer Surface.
        scenes: how many of every data set, the first ones; None are all.
        frames: how many of every scene, the first ones; None are all.
    """

    card: Card
    handle_collisions: bool
    threshold: float
    scenes: int | None = None
    frames: int | None = None


def make_folder(path: Path) -> None:
    """Make the folder that the report goes into.

    Raises:
        InputError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made ({error.strerror}); give another folder with -o") from None


def evaluation_report(
    subject: Subject,
    sets: Sequence[DataSet],
    scenes: Sequence[JudgedScene],
    skipped: Sequence[Skipped],
    folder: Path,
) -> dict:
    """All that an evaluation found, as plain data for JSON; file names are relative to ``folder`` where they can be."""
    strange = unseen(subject.card.seen, [scene.truth for scene in scenes])
    return {
        "model": {
            "name": subject.card.name,
            "about": subject.card.about,
            "handle_collisions": subject.handle_collisions,
        },
        "limits": {"scenes": subject.scenes, "frames": subject.frames},
        **definitions(subject.threshold),
        "data": [{**data_set_entry(one, scenes, skipped), "unseen": strange.get(one.name)} for one in sets],
        "means": [
            {
                "data": mean.data,
                "surface": mean.surface,
                "scenes": mean.scenes,
                "floors": mean.floors,
                "windows": beside(mean.model, mean.floor, mean.ratio),
            }
            for mean in summaries(scenes)
        ],
        "scenes": [
            {
                "data": scene.truth.data,
                "scene": scene.name,
                "trajectory": scene.rollout.relative_to(folder).as_posix(),
                "handle_collisions": scene.handle_collisions,
                **judgment_entry(scene.judgment),
            }
            for scene in scenes
        ],
    }


def definitions(threshold: float) -> dict:
    """What the numbers of a report mean."""
    return {
        "version": __version__,
        "frame_time": FRAME_TIME,
        "near": threshold,
        "metrics": [
            {"key": m.key, "name": m.name, "unit": m.unit, "places": m.places, "tells": m.tells} for m in METRICS
        ],
        "windows": [window.name for window in WINDOWS],
    }


def data_set_entry(one: DataSet, scenes: Sequence[JudgedScene], skipped: Sequence[Skipped]) -> dict:
    """A data set: how much of it was judged, and what was not."""
    members = [scene for scene in scenes if scene.truth.data == one.name]
    floors = sum(bool(scene.judgment.floors) for scene in members)
    left_out = [bad for bad in skipped if bad.file.is_relative_to(one.folder)]
    return {
        "name": one.name,
        "files": len(one.paths),
        "scenes": len(members),
        "floors": floors,
        "floor_missing": None if floors == len(members) else HOW_TO_MAKE.format(one.folder),
        "skipped": [{"file": bad.file.relative_to(one.folder).as_posix(), "reason": bad.reason} for bad in left_out],
    }


def judgment_entry(judgment: Judgment) -> dict:
    """One scene: numbers by window, and curves frame by frame."""
    return {
        "surface": judgment.surface,
        "particles": judgment.particles,
        "frames": len(judgment.own),
        "repeats": len(judgment.floors),
        "windows": beside(judgment.scores, judgment.floor, ratios(judgment.scores, judgment.floor)),
        "curves": curves(judgment.own, judgment.floors),
    }


def beside(model: ByWindow, floor: ByWindow, ratio: ByWindow) -> dict:
    """Window -> metric -> model, floor and ratio."""
    return {
        window: {
            key: {"model": value, "floor": floor.get(window, {}).get(key), "ratio": ratio.get(window, {}).get(key)}
            for key, value in values.items()
        }
        for window, values in model.items()
    }


def curves(own: Comparison, floors: Sequence[Comparison]) -> dict:
    """Quantity -> model, floor (mean of the repeats) and, of what a trajectory has by itself, truth: (frames,) each."""
    found = {
        name: {"model": plain(getattr(own, name)), "floor": mean_curve([getattr(one, name) for one in floors])}
        for name in CHAMFERS
    }
    for name in COURSES:
        found[name] = {
            "model": plain(getattr(own.own, name)),
            "truth": plain(getattr(own.true, name)),
            "floor": mean_curve([getattr(one.own, name) for one in floors]),
        }
    return found


def mean_curve(repeats: Sequence[np.ndarray]) -> list[float | None] | None:
    """The mean of the repeats' curves; None where there are none."""
    return plain(np.mean(repeats, axis=0)) if repeats else None


def plain(values: np.ndarray) -> list[float | None]:
    """Values as JSON has them: None where there is no number."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values]


def write_json(path: Path, report: dict) -> None:
    """Write ``report``.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        path.write_text(json.dumps(report, allow_nan=False, separators=(",", ":")) + "\n")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
