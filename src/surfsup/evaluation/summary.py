"""Means over scenes, by data set and by surface, each beside the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from surfsup.evaluation.evaluate import JudgedScene
from surfsup.evaluation.scores import ByWindow, mean_scores, ratios

EVERY_SURFACE = "all"


@dataclass(frozen=True)
class Summary:
    """The mean of some scenes.

    Attributes:
        data: name of their data set.
        surface: kind of solid that they share, or 'all'.
        scenes: how many.
        floors: how many of them have a floor.
        model: mean over all.
        floor: mean over those that have one; empty if none has.
        ratio: the model's mean over these same scenes, over their floor.
    """

    data: str
    surface: str
    scenes: int
    floors: int
    model: ByWindow
    floor: ByWindow
    ratio: ByWindow


def summary(data: str, surface: str, scenes: Sequence[JudgedScene]) -> Summary:
    """The means over ``scenes``."""
    judgments = [scene.judgment for scene in scenes]
    grounded = [judgment for judgment in judgments if judgment.floor]
    floor = mean_scores([judgment.floor for judgment in grounded])
    beside = mean_scores([judgment.scores for judgment in grounded])
    model = mean_scores([judgment.scores for judgment in judgments])
    return Summary(data, surface, len(scenes), len(grounded), model, floor, ratios(beside, floor))


def summaries(scenes: Sequence[JudgedScene]) -> list[Summary]:
    """For each data set the mean of each kind of surface, then that of all."""
    found = []
    for data in unique(scene.truth.data for scene in scenes):
        members = [scene for scene in scenes if scene.truth.data == data]
        for kind in unique(scene.judgment.surface for scene in members):
            found.append(summary(data, kind, [scene for scene in members if scene.judgment.surface == kind]))
        found.append(summary(data, EVERY_SURFACE, members))
    return found


def unique(names: Sequence[str]) -> list[str]:
    """``names`` in the order in which they come first."""
    return list(dict.fromkeys(names))
