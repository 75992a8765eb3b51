"""Evaluations as text tables for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from surfsup.evaluation.evaluate import EvaluatedScene, Evaluation
from surfsup.evaluation.floor import FLOOR_HINT
from surfsup.evaluation.load_trajectories import DataSet, SkippedFile
from surfsup.evaluation.report import EvaluationSettings
from surfsup.evaluation.scores import ALL, METRICS, Metric, MetricValues, floor_ratios
from surfsup.evaluation.summary import Summary, summaries

NO_VALUE = "-"
LABEL, COLUMN, RATIO = 19, 9, 6  # widths in characters
METRIC_BY_KEY = {metric.key: metric for metric in METRICS}
DISTANCES = ("chamfer", "chamfer_squared", "surface", "surface_squared")
PHYSICS = ("height", "energy", "energy_error", "rebound")
COUNTS = ("density", "penetration", "depth", "lost")
Row = tuple[str, MetricValues | None, MetricValues | None, MetricValues | None]  # label; scores, floor, ratio


def evaluation_text(
    settings: EvaluationSettings,
    scenes: Sequence[EvaluatedScene],
    sets: Sequence[DataSet],
    skipped: Sequence[SkippedFile],
) -> str:
    """The means by data set, by surface and by time, with the floor, and the skipped files."""
    means, lines = summaries(scenes), []
    for one in sets:
        members = [mean for mean in means if mean.data_set == one.name]
        if members:
            lines += data_set_lines(one, members, settings)
            if settings.handle_collisions:
                shares = [scene.collided_share for scene in scenes if scene.reference.data_set == one.name]
                lines.append(collision_line(shares))
            lines += far_lines([scene.evaluation for scene in scenes if scene.reference.data_set == one.name])
            lines.append("")
    return "\n".join([*lines, *legend(), *skipped_lines(skipped)])


def data_set_lines(one: DataSet, members: Sequence[Summary], settings: EvaluationSettings) -> list[str]:
    """One data set: each kind of surface over all frames, then all surfaces over time."""
    whole = members[-1]
    with_floor = bool(whole.floors)
    lines = [f"{one.name}: {plural_scenes(whole.scenes)}, {floor_text(whole, one)}; {settings_text(settings)}"]
    for keys in (DISTANCES, PHYSICS):
        metrics = [METRIC_BY_KEY[key] for key in keys]
        by_surface = [(f"{mean.surface} ({mean.scenes})", *values_of(mean, ALL)) for mean in members]
        over_time = [(window, *values_of(whole, window)) for window in whole.scores if window != ALL]
        lines += ["", *header(metrics, with_floor), "all frames", *rows(by_surface, metrics, with_floor)]
        lines += ["all surfaces, frames", *rows(over_time, metrics, with_floor)] if over_time else []
    counts = [
        f"{METRIC_BY_KEY[key].name} {value_with_floor(METRIC_BY_KEY[key], *values_of(whole, ALL)[:2])}"
        for key in COUNTS
    ]
    return [*lines, "", f"mean of a scene: {'; '.join(counts)}"]


def trajectory_text(evaluation: Evaluation) -> str:
    """One evaluated trajectory, over time."""
    with_floor = bool(evaluation.floor)
    ratio = floor_ratios(evaluation.scores, evaluation.floor)
    lines = []
    for keys in (DISTANCES, PHYSICS, COUNTS):
        metrics = [METRIC_BY_KEY[key] for key in keys]
        values = [
            (window, scores, evaluation.floor.get(window), ratio.get(window))
            for window, scores in evaluation.scores.items()
        ]
        lines += [*header(metrics, with_floor), *rows(values, metrics, with_floor), ""]
    return "\n".join([*lines, *far_lines([evaluation]), *legend()])


def far_lines(evaluations: Sequence[Evaluation]) -> list[str]:
    """The number of scenes in which the solid was not reached, whose zeros at the solid say nothing."""
    far = sum(not evaluation.reached_solid for evaluation in evaluations)
    if not far:
        return []
    where = "no particle came" if len(evaluations) == 1 else f"in {far} of {len(evaluations)} scenes no particle came"
    return [f"{where} near a solid: Chamfer Surface and Surface Penetration are 0 there and say nothing"]


def settings_text(settings: EvaluationSettings) -> str:
    """The simulator and how it was evaluated."""
    text = f"'{settings.name}' {'with' if settings.handle_collisions else 'without'} collision handling"
    return text if settings.frames is None else f"{text}, the first {settings.frames} frames"


def values_of(mean: Summary, window: str) -> tuple[MetricValues | None, MetricValues | None, MetricValues | None]:
    """Scores, floor and ratio over one window."""
    return mean.scores.get(window), mean.floor.get(window), mean.ratio.get(window)


def header(metrics: Sequence[Metric], with_floor: bool) -> list[str]:
    """The lines above the columns of ``metrics``, with columns for floor and ratio if the table has them."""
    width = COLUMN + (COLUMN + RATIO if with_floor else 0)
    names = [f"{metric.name}{', ' + metric.unit if metric.unit else ''}" for metric in metrics]
    if not with_floor:
        width = max(COLUMN, *(len(name) + 2 for name in names))
        return [" " * LABEL + "".join(f"{name:>{width}}" for name in names)]
    below = f"{'value':>{COLUMN}}{'floor':>{COLUMN}}{'ratio':>{RATIO}}"
    return [" " * LABEL + "".join(f"{name:>{width}}" for name in names), " " * LABEL + below * len(metrics)]


def rows(values: Sequence[Row], metrics: Sequence[Metric], with_floor: bool) -> list[str]:
    """One line for each label."""
    width = COLUMN if with_floor else len(header(metrics, False)[0][LABEL:]) // len(metrics)
    lines = []
    for label, scores, floor, ratio in values:
        line = f"  {label:<{LABEL - 2}}"
        for metric in metrics:
            line += f"{format_value(scores, metric):>{width}}"
            if with_floor:
                line += f"{format_value(floor, metric):>{COLUMN}}{format_ratio(ratio, metric):>{RATIO}}"
        lines.append(line)
    return lines


def format_value(values: MetricValues | None, metric: Metric) -> str:
    """A value with the metric's decimals; a mean of counts that is not a whole number has one decimal."""
    value = None if values is None else values[metric.key]
    if value is None:
        return NO_VALUE
    decimals = metric.decimals if metric.decimals or value == int(value) else 1
    return shortened(f"{value:.{decimals}f}", value, COLUMN)


def format_ratio(ratios: MetricValues | None, metric: Metric) -> str:
    """A ratio to the floor."""
    value = None if ratios is None else ratios[metric.key]
    return NO_VALUE if value is None else shortened(f"{value:.2f}" if value < 100 else f"{value:.0f}", value, RATIO)


def shortened(text: str, value: float, width: int) -> str:
    """``text``, or the value's power of ten if the text is too wide, as for a diverged rollout."""
    return text if len(text) < width else f"{value:.0e}".replace("e+", "e")


def value_with_floor(metric: Metric, scores: MetricValues | None, floor: MetricValues | None) -> str:
    """A value, with the floor's value in parentheses."""
    unit = f" {metric.unit}" if metric.unit else ""
    return f"{format_value(scores, metric)}{unit}" + (f" (floor {format_value(floor, metric)})" if floor else "")


def floor_text(whole: Summary, one: DataSet) -> str:
    """How many scenes have a floor, and how to make the missing ones."""
    if whole.floors == whole.scenes:
        return "all with a floor"
    hint = FLOOR_HINT.format(one.folder)
    return f"no floor ({hint})" if not whole.floors else f"{whole.floors} with a floor ({hint})"


def collision_line(collided_shares: Sequence[float]) -> str:
    """The mean share of particles that collision handling moved."""
    share = sum(collided_shares) / len(collided_shares)
    return f"collision handling moved {100 * share:.2f} % of the particles in a frame"


def legend() -> list[str]:
    """One line for each metric, then the meaning of floor and ratio."""
    return [f"{metric.name}: {metric.description}" for metric in METRICS] + [
        "floor: the reference against its repeats with the water moved by 1 mm; ratio: value over floor, 1 is best"
    ]


def skipped_lines(skipped: Sequence[SkippedFile]) -> list[str]:
    """Every skipped file, and why."""
    return ["", f"{len(skipped)} skipped:", *(f"  {one.file}: {one.reason}" for one in skipped)] if skipped else []


def plural_scenes(count: int) -> str:
    """The number of scenes in words."""
    return f"{count} scene{'' if count == 1 else 's'}"
