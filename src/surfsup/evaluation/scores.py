"""Metrics over windows of frames, their means over scenes, and their ratios to the reproducibility floor."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from surfsup.evaluation.compare import Comparison

MetricValues = dict[str, float | None]  # key of a metric -> value; None where it is undefined
WindowScores = dict[str, MetricValues]  # name of a window -> values


@dataclass(frozen=True)
class Metric:
    """One number that summarizes a window of a comparison.

    Attributes:
        key: its name in ``report.json``.
        name: its name in tables.
        unit: of the value; empty for a dimensionless number.
        decimals: to show.
        compute: the value over a window of frames.
        description: one line.
        skip_undefined: whether means leave out scenes without a value. Otherwise a mean with such a scene is undefined.
    """

    key: str
    name: str
    unit: str
    decimals: int
    compute: Callable[[Comparison, slice], float]
    description: str
    skip_undefined: bool = False


@dataclass(frozen=True)
class Window:
    """The frames from ``first`` up to, but not including, ``last``; None is the end."""

    name: str
    first: int
    last: int | None

    def frames(self, count: int) -> slice:
        """The window's part of ``count`` frames; empty where it begins after them."""
        return slice(min(self.first, count), count if self.last is None else min(self.last, count))

    def adds(self, count: int) -> bool:
        """Whether ``count`` frames reach the window, and it is not all of them under another name."""
        return count > self.first and (self.last is None or self.first > 0 or self.last <= count)


WINDOWS = (
    Window("0-100", 0, 100),  # the fall: nearly deterministic
    Window("100-200", 100, 200),  # impact
    Window("200-300", 200, 300),  # splash: chaotic
    Window("300-end", 300, None),  # the water comes to rest
    Window("first 300", 0, 300),
    Window("all", 0, None),
)
ALL = WINDOWS[-1].name


def mean_depth(comparison: Comparison, window: slice) -> float:
    """Mean signed distance of the particles inside the solid, meters; NaN if there are none."""
    inside = comparison.prediction.inside[window].sum()
    return comparison.prediction.depth[window].sum() / inside if inside else math.nan


def rebound(height: np.ndarray) -> float:
    """The largest rise of a height (frames,) above its earlier minimum."""
    return float((height - np.minimum.accumulate(height)).max())


def peak(density: np.ndarray) -> float:
    """The largest of the densities that were computed; NaN if there are none."""
    finite = density[np.isfinite(density)]
    return float(finite.max()) if len(finite) else math.nan


def energy_ratio(prediction: float, reference: float) -> float:
    """Predicted over reference energy; 1 where both are 0, as for water at rest."""
    if reference == 0:
        return 1.0 if prediction == 0 else math.inf
    return prediction / reference


def energy_error(comparison: Comparison, window: slice) -> float:
    """Absolute error of the kinetic energy, summed over frames, relative to the reference."""
    true = comparison.reference.energy[window]
    return energy_ratio(np.abs(comparison.prediction.energy[window] - true).sum(), true.sum())


# fmt: off
METRICS = (
    Metric("chamfer", "Chamfer", "m", 4, lambda c, window: c.chamfer[window].mean(),
           "mean distance to the nearest particle of the other set, both directions added; particles are 0.03 m apart"),
    Metric("chamfer_squared", "Chamfer squared", "m²", 6, lambda c, window: c.chamfer_squared[window].mean(),
           "the same with squared distances, as in the paper's formula; a few stray particles weigh more"),
    Metric("surface", "Chamfer Surface", "m", 2, lambda c, window: c.surface[window].mean(),
           "summed over the particles near the solid only, both directions: errors where water meets the solid"),
    Metric("surface_squared", "Surface squared", "m²", 4, lambda c, window: c.surface_squared[window].mean(),
           "the same with squared distances, as in the paper's formula"),
    Metric("penetration", "Surface Penetration", "", 0, lambda c, window: c.prediction.inside[window].sum(),
           "particles inside the solid, summed over frames; should be 0"),
    Metric("depth", "Mean Inside Surface", "m", 5, mean_depth,
           "mean signed distance of the particles inside the solid; empty if there are none", skip_undefined=True),
    Metric("height", "height error", "m", 4,
           lambda c, window: np.abs(c.prediction.height[window] - c.reference.height[window]).mean(),
           "absolute error of the height of the center of mass, mean over frames"),
    Metric("energy", "energy ratio", "", 3,
           lambda c, window: energy_ratio(c.prediction.energy[window].sum(), c.reference.energy[window].sum()),
           "kinetic energy summed over frames, over the reference's; below 1 is too calm, above 1 too wild"),
    Metric("energy_error", "energy error", "", 4, energy_error,
           "absolute error of the kinetic energy summed over frames, over the reference's; errors do not cancel"),
    Metric("rebound", "rebound error", "m", 4,
           lambda c, window: abs(rebound(c.prediction.height[window]) - rebound(c.reference.height[window])),
           "absolute error of the height that the center of mass regains after impact"),
    Metric("density", "highest density", "", 3,
           lambda c, window: peak(c.prediction.density[window]) / peak(c.reference.density[window]),
           "over the reference's highest; above 1 the fluid is more compressed than water"),
    Metric("lost", "particles lost", "", 0, lambda c, window: c.prediction.lost[window].sum(),
           "particles outside the container, not finite or above 30 m/s, summed over frames; should be 0"),
)
# fmt: on


def compute_scores(comparison: Comparison) -> WindowScores:
    """Every metric over all frames, and over every other window that says more."""
    count = len(comparison)
    windows = {window.name: window.frames(count) for window in WINDOWS if window.adds(count)}
    return {
        name: {metric.key: finite_or_none(metric.compute(comparison, frames)) for metric in METRICS}
        for name, frames in windows.items()
    }


def mean_scores(scores: Sequence[WindowScores]) -> WindowScores:
    """The mean of every metric over scenes or repeats, for the windows that all of them reach.

    A diverged rollout has no value, so the mean has none either.
    """
    if not scores:
        return {}
    windows = [name for name in scores[0] if all(name in one for one in scores)]
    return {
        name: {
            metric.key: mean_value([one[name][metric.key] for one in scores], metric.skip_undefined)
            for metric in METRICS
        }
        for name in windows
    }


def mean_value(values: Sequence[float | None], skip_undefined: bool) -> float | None:
    """The mean of ``values``; None if one is undefined and these are not skipped, or if all are undefined."""
    defined = [value for value in values if value is not None]
    return float(np.mean(defined)) if defined and (skip_undefined or len(defined) == len(values)) else None


def floor_ratios(scores: WindowScores, floor: WindowScores) -> WindowScores:
    """Every value over the floor's, for the windows that both have."""
    return {
        name: {key: floor_ratio(value, floor[name][key]) for key, value in scores[name].items()}
        for name in scores
        if name in floor
    }


def floor_ratio(value: float | None, floor: float | None) -> float | None:
    """A value over the floor's; 1 where both are 0, None where one is undefined or only the floor is 0."""
    if value is None or floor is None or (floor == 0 and value != 0):
        return None
    return 1.0 if floor == 0 else value / floor


def finite_or_none(value: float) -> float | None:
    """The value as a Python number; None for NaN and infinity, which JSON does not have."""
    return float(value) if math.isfinite(value) else None
