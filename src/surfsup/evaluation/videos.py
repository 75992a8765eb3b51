"""The best, the median and the worst scene of an evaluation, model and truth side by side as videos."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from surfsup.errors import InputError
from surfsup.evaluation.evaluate import JudgedScene
from surfsup.evaluation.scores import ALL
from surfsup.viewing.graphics import require_graphics
from surfsup.viewing.trajectory_pictures import write_side_by_side

FOLDER = "videos"


@dataclass(frozen=True)
class Example:
    """A scene that is shown, and why: 'best', 'median' or 'worst'."""

    rank: str
    scene: JudgedScene

    def file(self, report: Path) -> Path:
        """Its video in the folder of the report."""
        return report / FOLDER / f"{self.rank}.mp4"


def examples(scenes: Sequence[JudgedScene]) -> list[Example]:
    """The scenes of smallest, middle and largest Chamfer distance; of fewer than three as many as there are.

    A rollout that blew up is worse than any other.
    """

    def distance(scene: JudgedScene) -> float:
        chamfer = scene.judgment.scores[ALL]["chamfer"]
        return math.inf if chamfer is None else chamfer

    ranked = sorted(scenes, key=distance)
    places = {"best": 0, "worst": len(ranked) - 1, "median": (len(ranked) - 1) // 2}
    chosen = {place: rank for rank, place in reversed(places.items())}  # one scene is shown once
    return [Example(chosen[place], ranked[place]) for place in sorted(chosen)]


def why_no_videos() -> str | None:
    """Why this machine cannot draw videos and what to install, None where it can."""
    try:
        require_graphics()
    except InputError as error:
        return f"no videos in the page: {error}"
    return None


def write_videos(
    report: Path, chosen: Sequence[Example], model: str, tell: Callable[[int, int], None] = lambda done, total: None
) -> None:
    """Draw every one of ``chosen`` into the folder of the report; minutes.

    Raises:
        InputError: this machine cannot draw off screen.
    """
    for number, example in enumerate(chosen):

        def told(done: int, total: int, number: int = number) -> None:
            tell(number * total + done, len(chosen) * total)

        labels = (f"model '{model}'", "truth (SPlisHSPlasH)")
        write_side_by_side(example.scene.rollout, example.scene.truth.path, labels, example.file(report), told)
