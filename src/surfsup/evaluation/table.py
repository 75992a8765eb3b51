"""Judgments as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

from surfsup.evaluation.evaluate import JudgedScene, Judgment
from surfsup.evaluation.floor import HOW_TO_MAKE
from surfsup.evaluation.load_trajectories import DataSet, Skipped
from surfsup.evaluation.report import Subject
from surfsup.evaluation.scores import ALL, METRICS, Metric, Values, ratios
from surfsup.evaluation.summary import Summary, summaries

NOTHING = "-"
LABEL, COLUMN, RATIO = 19, 9, 6  # characters
BY_KEY = {metric.key: metric for metric in METRICS}
DISTANCES = ("chamfer", "chamfer_squared", "surface", "surface_squared")
PHYSICS = ("height", "energy", "energy_error", "rebound")
COUNTS = ("density", "penetration", "depth", "lost")
Row = tuple[str, Values | None, Values | None, Values | None]  # label; own, floor, ratio


def evaluation_text(
    subject: Subject, scenes: Sequence[JudgedScene], sets: Sequence[DataSet], skipped: Sequence[Skipped]
) -> str:
    """The means by data set and surface and over time, the floor beside them, and what was skipped."""
    means, lines = summaries(scenes), []
    for one in sets:
        members = [mean for mean in means if mean.data == one.name]
        if members:
            lines += data_set_lines(one, members, subject)
            if subject.handle_collisions:
                lines.append(guard_line([scene.handle_collisions for scene in scenes if scene.truth.data == one.name]))
            lines.append("")
    lines += [*legend(BY_KEY), *skipped_lines(skipped)]
    return "\n".join(lines)


def data_set_lines(one: DataSet, members: Sequence[Summary], subject: Subject) -> list[str]:
    """One data set: by surface over all frames, then all surfaces over time."""
    whole = members[-1]
    lines = [f"{one.name}: {scenes_of(whole.scenes)}, {floor_of(whole, one)}; {how(subject)}"]
    for keys in (DISTANCES, PHYSICS):
        by_surface = [(f"{mean.surface} ({mean.scenes})", *values_of(mean, ALL)) for mean in members]
        over_time = [(window, *values_of(whole, window)) for window in whole.model if window != ALL]
        metrics = [BY_KEY[key] for key in keys]
        lines += ["", *head(metrics, bool(whole.floors)), "all frames", *rows(by_surface, metrics, bool(whole.floors))]
        lines += ["all surfaces, frames", *rows(over_time, metrics, bool(whole.floors))]
    counts = [f"{BY_KEY[key].name} {value_with_floor(BY_KEY[key], *values_of(whole, ALL)[:2])}" for key in COUNTS]
    return [*lines, "", f"mean of a scene: {'; '.join(counts)}"]


def judgment_text(judgment: Judgment) -> str:
    """One trajectory against its truth, over time."""
    grounded = bool(judgment.floor)
    ratio = ratios(judgment.scores, judgment.floor)
    lines = []
    for keys in (DISTANCES, PHYSICS, COUNTS):
        metrics = [BY_KEY[key] for key in keys]
        values = [
            (window, judgment.scores[window], judgment.floor.get(window), ratio.get(window))
            for window in judgment.scores
        ]
        lines += [*head(metrics, grounded, "judged"), *rows(values, metrics, grounded), ""]
    return "\n".join([*lines, *legend(BY_KEY)])


def how(subject: Subject) -> str:
    """What of the model was judged, and over how much."""
    what = f"'{subject.card.name}' {'with' if subject.handle_collisions else 'without'} the guard"
    return what if subject.frames is None else f"{what}, the first {subject.frames} frames"


def values_of(mean: Summary, window: str) -> tuple[Values | None, Values | None, Values | None]:
    """Model, floor and ratio over one window."""
    return mean.model.get(window), mean.floor.get(window), mean.ratio.get(window)


def head(metrics: Sequence[Metric], grounded: bool, own: str = "model") -> list[str]:
    """The two lines above the columns of ``metrics``, with floor and ratio where the table has them."""
    width = COLUMN + (COLUMN + RATIO if grounded else 0)
    names = [f"{metric.name}{', ' + metric.unit if metric.unit else ''}" for metric in metrics]
    if not grounded:
        width = max(COLUMN, *(len(name) + 2 for name in names))
        return [" " * LABEL + "".join(f"{name:>{width}}" for name in names)]
    below = f"{own:>{COLUMN}}{'floor':>{COLUMN}}{'ratio':>{RATIO}}"
    return [" " * LABEL + "".join(f"{name:>{width}}" for name in names), " " * LABEL + below * len(metrics)]


def rows(values: Sequence[Row], metrics: Sequence[Metric], grounded: bool) -> list[str]:
    """A line for each label."""
    width = COLUMN if grounded else len(head(metrics, False)[0][LABEL:]) // len(metrics)
    lines = []
    for label, own, floor, ratio in values:
        line = f"  {label:<{LABEL - 2}}"
        for metric in metrics:
            line += f"{shown(own, metric):>{width}}"
            if grounded:
                line += f"{shown(floor, metric):>{COLUMN}}{shown_ratio(ratio, metric):>{RATIO}}"
        lines.append(line)
    return lines


def shown(values: Values | None, metric: Metric) -> str:
    """A value at the metric's precision; a mean of counts that is no whole number keeps a decimal."""
    value = None if values is None else values[metric.key]
    if value is None:
        return NOTHING
    places = metric.places if metric.places or value == int(value) else 1
    return fitting(f"{value:.{places}f}", value, COLUMN)


def shown_ratio(ratios_: Values | None, metric: Metric) -> str:
    """A ratio to the floor."""
    value = None if ratios_ is None else ratios_[metric.key]
    return NOTHING if value is None else fitting(f"{value:.2f}" if value < 100 else f"{value:.0f}", value, RATIO)


def fitting(text: str, value: float, width: int) -> str:
    """``text``, or where a column is too narrow for it, as after a rollout that blew up, the value's power of ten."""
    return text if len(text) < width else f"{value:.0e}".replace("e+", "e")


def value_with_floor(metric: Metric, own: Values | None, floor: Values | None) -> str:
    """A value and in brackets the floor's."""
    unit = f" {metric.unit}" if metric.unit else ""
    return f"{shown(own, metric)}{unit}" + (f" (floor {shown(floor, metric)})" if floor else "")


def floor_of(whole: Summary, one: DataSet) -> str:
    """Which scenes have a floor, and what to do for those that have none."""
    if whole.floors == whole.scenes:
        return "all with their floor"
    missing = HOW_TO_MAKE.format(one.folder)
    return f"no floor ({missing})" if not whole.floors else f"floor of {whole.floors} of them ({missing})"


def guard_line(handle_collisions: Sequence[float]) -> str:
    """How much the guard had to do."""
    return f"the guard moved {100 * sum(handle_collisions) / len(handle_collisions):.2f} % of the particles in a frame"


def legend(keys: Sequence[str]) -> list[str]:
    """What the columns mean, a line each."""
    return [f"{BY_KEY[key].name}: {BY_KEY[key].tells}" for key in keys] + [
        "floor: the truth against itself, started 1 mm away; ratio: value over floor, 1 is as good as can be"
    ]


def skipped_lines(skipped: Sequence[Skipped]) -> list[str]:
    """Every file that was not used, and why."""
    return ["", f"{len(skipped)} skipped:", *(f"  {one.file}: {one.reason}" for one in skipped)] if skipped else []


def scenes_of(count: int) -> str:
    """So many scenes."""
    return f"{count} scene{'' if count == 1 else 's'}"
