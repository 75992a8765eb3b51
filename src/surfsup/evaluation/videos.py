"""Videos of the best, the median and the worst scene of an evaluation, prediction and reference side by side."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from surfsup.errors import InputError
from surfsup.evaluation.evaluate import EvaluatedScene
from surfsup.evaluation.scores import ALL
from surfsup.viewing.graphics import require_graphics
from surfsup.viewing.trajectory_pictures import write_comparison_video

FOLDER = "videos"


@dataclass(frozen=True)
class Example:
    """A scene to show, and its rank: 'best', 'median' or 'worst'."""

    rank: str
    scene: EvaluatedScene

    def file(self, report: Path) -> Path:
        """Its video in the folder of the report."""
        return report / FOLDER / f"{self.rank}.mp4"


def select_examples(scenes: Sequence[EvaluatedScene]) -> list[Example]:
    """The scenes with the smallest, the median and the largest Chamfer distance; fewer if there are fewer scenes.

    A diverged rollout is worse than any other.
    """

    def distance(scene: EvaluatedScene) -> float:
        chamfer = scene.evaluation.scores[ALL]["chamfer"]
        return math.inf if chamfer is None else chamfer

    ranked = sorted(scenes, key=distance)
    places = {"best": 0, "worst": len(ranked) - 1, "median": (len(ranked) - 1) // 2}
    chosen = {place: rank for rank, place in reversed(places.items())}  # shows no scene twice
    return [Example(chosen[place], ranked[place]) for place in sorted(chosen)]


def missing_graphics() -> str | None:
    """Why this machine cannot render videos and what to install; None if it can."""
    try:
        require_graphics()
    except InputError as error:
        return f"no videos in the page: {error}"
    return None


def write_videos(
    report: Path,
    examples: Sequence[Example],
    name: str,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Render the ``examples`` into the folder of the report; this takes minutes.

    Args:
        report: folder of the report.
        examples: scenes to render.
        name: of the simulator, for the labels.
        progress: called with the numbers of finished and of all video frames.

    Raises:
        InputError: this machine cannot render off screen.
    """
    for number, example in enumerate(examples):

        def frame_done(done: int, total: int, number: int = number) -> None:
            progress(number * total + done, len(examples) * total)

        labels = (name, "reference (SPlisHSPlasH)")
        reference = example.scene.reference.path
        write_comparison_video(example.scene.rollout, reference, labels, example.file(report), frame_done)
