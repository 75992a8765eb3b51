"""Mean scores over scenes, by data set and by kind of surface, with the reproducibility floor."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from surfsup.evaluation.evaluate import EvaluatedScene
from surfsup.evaluation.scores import WindowScores, floor_ratios, mean_scores

ALL_SURFACES = "all"


@dataclass(frozen=True)
class Summary:
    """Mean scores of some scenes.

    Attributes:
        data_set: name of their data set.
        surface: their kind of solid, or 'all'.
        scenes: number of scenes.
        floors: number of scenes that have a floor.
        scores: mean over all scenes.
        floor: mean over the scenes that have a floor; empty if none has.
        ratio: mean scores of the scenes that have a floor, over their floor.
    """

    data_set: str
    surface: str
    scenes: int
    floors: int
    scores: WindowScores
    floor: WindowScores
    ratio: WindowScores


def summarize(data_set: str, surface: str, scenes: Sequence[EvaluatedScene]) -> Summary:
    """The mean scores of ``scenes``."""
    evaluations = [scene.evaluation for scene in scenes]
    with_floor = [evaluation for evaluation in evaluations if evaluation.floor]
    floor = mean_scores([evaluation.floor for evaluation in with_floor])
    ratio = floor_ratios(mean_scores([evaluation.scores for evaluation in with_floor]), floor)
    scores = mean_scores([evaluation.scores for evaluation in evaluations])
    return Summary(data_set, surface, len(scenes), len(with_floor), scores, floor, ratio)


def summaries(scenes: Sequence[EvaluatedScene]) -> list[Summary]:
    """For each data set one summary of each kind of surface, then one of all its scenes."""
    found = []
    for data_set in unique(scene.reference.data_set for scene in scenes):
        members = [scene for scene in scenes if scene.reference.data_set == data_set]
        for kind in unique(scene.evaluation.surface for scene in members):
            found.append(summarize(data_set, kind, [scene for scene in members if scene.evaluation.surface == kind]))
        found.append(summarize(data_set, ALL_SURFACES, members))
    return found


def unique(names: Iterable[str]) -> list[str]:
    """``names`` without repetitions, in the order of their first appearance."""
    return list(dict.fromkeys(names))
