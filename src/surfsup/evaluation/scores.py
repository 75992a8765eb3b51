"""From curves to numbers: every metric over every window of frames, its mean over scenes, its ratio to the floor."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from surfsup.evaluation.compare import Comparison

Values = dict[str, float | None]  # metric's key -> value; None where there is nothing to average
ByWindow = dict[str, Values]  # window's name -> values


@dataclass(frozen=True)
class Metric:
    """One number about a stretch of a comparison.

    Attributes:
        key: its name in ``report.json``.
        name: what people read.
        unit: of the value; empty for a plain number.
        places: after the decimal point.
        tells: in one line.
        of: the value over a window of frames.
        seldom: whether a scene may well have no value; means are then over those that have one.
    """

    key: str
    name: str
    unit: str
    places: int
    tells: str
    of: Callable[[Comparison, slice], float]
    seldom: bool = False


@dataclass(frozen=True)
class Window:
    """A stretch of frames, from ``first`` to before ``last``; None is the end, whatever the length."""

    name: str
    first: int
    last: int | None

    def frames(self, count: int) -> slice:
        """The window's part of ``count`` frames; empty where it begins after them."""
        return slice(min(self.first, count), count if self.last is None else min(self.last, count))


WINDOWS = (
    Window("0-100", 0, 100),  # the fall: nearly deterministic
    Window("100-200", 100, 200),  # impact
    Window("200-300", 200, 300),  # splash: chaos
    Window("300-end", 300, None),  # the pool comes to rest
    Window("first 300", 0, 300),
    Window("all", 0, None),
)
FIRST_300, ALL = WINDOWS[-2].name, WINDOWS[-1].name


def mean_depth(of: Comparison, window: slice) -> float:
    """Mean distance of the particles inside the solid, meters; NaN if there were none."""
    inside = of.own.inside[window].sum()
    return of.own.depth[window].sum() / inside if inside else math.nan


def rebound(height: np.ndarray) -> float:
    """How far a height (frames,) climbs back above the lowest that it had been at before, at most."""
    return float((height - np.minimum.accumulate(height)).max())


def highest(density: np.ndarray) -> float:
    """The highest of the densities that were taken; NaN if there were none."""
    taken = density[np.isfinite(density)]
    return float(taken.max()) if len(taken) else math.nan


METRICS = (
    Metric(
        "chamfer",
        "Chamfer",
        "m",
        4,
        "mean distance to the nearest particle of the other, both ways added; particles are 0.03 m apart",
        lambda of, window: of.chamfer[window].mean(),
    ),
    Metric(
        "chamfer_squared",
        "Chamfer squared",
        "m²",
        6,
        "the same of squared distances, as the paper prints its formula; a few strays weigh more",
        lambda of, window: of.chamfer_squared[window].mean(),
    ),
    Metric(
        "surface",
        "Chamfer Surface",
        "m",
        2,
        "summed over the particles near the solid only, both ways: errors where water meets the solid",
        lambda of, window: of.surface[window].mean(),
    ),
    Metric(
        "surface_squared",
        "Surface squared",
        "m²",
        4,
        "the same of squared distances, as the paper prints its formula",
        lambda of, window: of.surface_squared[window].mean(),
    ),
    Metric(
        "penetration",
        "Surface Penetration",
        "",
        0,
        "particles inside the solid, summed over frames; should be 0",
        lambda of, window: of.own.inside[window].sum(),
    ),
    Metric(
        "depth",
        "Mean Inside Surface",
        "m",
        5,
        "mean signed distance of those; empty if there are none",
        mean_depth,
        seldom=True,
    ),
    Metric(
        "height",
        "height error",
        "m",
        4,
        "how far the center of mass is too high or too low, mean over frames",
        lambda of, window: np.abs(of.own.height[window] - of.true.height[window]).mean(),
    ),
    Metric(
        "energy",
        "energy ratio",
        "",
        3,
        "kinetic energy summed over frames, over the truth's; 1 is right, less is sluggish, more is too wild",
        lambda of, window: ratio(of.own.energy[window].sum(), of.true.energy[window].sum()),
    ),
    Metric(
        "energy_error",
        "energy error",
        "",
        4,
        "difference of the kinetic energies, summed over frames, over the truth's: what cancels in the ratio shows",
        lambda of, window: ratio(
            np.abs(of.own.energy[window] - of.true.energy[window]).sum(), of.true.energy[window].sum()
        ),
    ),
    Metric(
        "rebound",
        "rebound error",
        "m",
        4,
        "how far off the height is that the center of mass climbs back after impact",
        lambda of, window: abs(rebound(of.own.height[window]) - rebound(of.true.height[window])),
    ),
    Metric(
        "density",
        "highest density",
        "",
        3,
        "over the truth's highest; above 1 the fluid is squeezed more than water lets itself be",
        lambda of, window: highest(of.own.density[window]) / highest(of.true.density[window]),
    ),
    Metric(
        "lost",
        "particles lost",
        "",
        0,
        "particles out of the container, no longer numbers or past 30 m/s, summed over frames; should be 0",
        lambda of, window: of.own.lost[window].sum(),
    ),
)


def scores(of: Comparison) -> ByWindow:
    """Every metric over every window that the comparison reaches."""
    windows = {window.name: window.frames(len(of)) for window in WINDOWS}
    return {
        name: {metric.key: number(metric.of(of, frames)) for metric in METRICS}
        for name, frames in windows.items()
        if frames.stop > frames.start
    }


def mean_scores(all_scores: Sequence[ByWindow]) -> ByWindow:
    """The mean of every metric over scenes or repeats, for those windows that all of them reach.

    Where a rollout blew up and so has no value, the mean has none either.
    """
    if not all_scores:
        return {}
    windows = [name for name in all_scores[0] if all(name in one for one in all_scores)]
    return {
        name: {metric.key: mean_of([one[name][metric.key] for one in all_scores], metric.seldom) for metric in METRICS}
        for name in windows
    }


def mean_of(values: Sequence[float | None], seldom: bool) -> float | None:
    """The mean of ``values``, None if one is missing; of ``seldom`` ones the mean of those that are there."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known and (seldom or len(known) == len(values)) else None


def ratios(own: ByWindow, floor: ByWindow) -> ByWindow:
    """Every value over the floor's, for the windows that both have."""
    return {
        name: {key: quotient(own[name][key], floor[name][key]) for key in own[name]} for name in own if name in floor
    }


def quotient(value: float | None, floor: float | None) -> float | None:
    """One over the other; 1 where both are nothing, None where either is unknown or only the floor is nothing."""
    if value is None or floor is None or (floor == 0 and value != 0):
        return None
    return 1.0 if floor == 0 else value / floor


def ratio(energy: float, true_energy: float) -> float:
    """One over the other; 1 where both are nothing, as of water that stays at rest."""
    if true_energy == 0:
        return 1.0 if energy == 0 else math.inf
    return energy / true_energy


def number(value: float) -> float | None:
    """A Python number for JSON, which knows neither NaN nor infinity."""
    return float(value) if math.isfinite(value) else None
