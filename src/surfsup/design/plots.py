"""Plots of reward and parameters over the iterations, as figures 7 and 8 of the SURFSUP supplement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surfsup.design.run import DesignRun
from surfsup.errors import InputError
from surfsup.io.atomic_file import atomic_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLORS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown")
LINE_STYLES = ("-", "--", ":", "-.", (0, (5, 1)), (0, (1, 1)))
MIN_REMAINING_GAIN = 1e-4  # lower limit of the logarithmic axis
MAX_CURVES = len(COLORS)


def require_matplotlib() -> None:
    """Check that plots are possible.

    Raises:
        InputError: matplotlib is not installed.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise InputError("matplotlib is not installed; install it with: pip install 'surfsup[design]'") from None


def plot_runs(runs: Sequence[DesignRun], path: Path) -> Path:
    """Plot rewards and parameters of all runs of one task over the iterations; returns the path of the PNG."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    figure = Figure(figsize=(6.4, 6.0), layout="constrained", dpi=130)
    above, below = figure.subplots(2, 1, sharex=True)
    for number, run in enumerate(runs):
        style = LINE_STYLES[number % len(LINE_STYLES)]
        above.plot(run.rewards, color="0.15", linestyle=style, label=f"start {number + 1}")
        for color, (name, curve) in zip(COLORS, parameter_curves(run).items(), strict=False):
            label = name if number == 0 else None
            below.plot(curve, color=color, linestyle=style, label=label)
    above.set_ylabel("reward (mean log density)" if runs[0].task.name in ("bowl", "funnel") else "reward")
    units = {parameter.unit for parameter in runs[0].task.parameters.values()}
    below.set_ylabel("parameter" + (f", {units.pop()}" if len(units) == 1 and "" not in units else ""))
    below.set_xlabel("iteration")
    below.legend(frameon=False)
    set_style(above, below)
    below.xaxis.set_major_locator(MaxNLocator(integer=True))
    if len(runs) > 1:
        above.legend(frameon=False)
    above.set_title(f"{runs[0].task.name}: {len(runs)} starts" if len(runs) > 1 else runs[0].task.name)
    with atomic_file(path) as partial:
        figure.savefig(partial, format="png")
    return path


def plot_baselines(best_so_far: Mapping[str, Sequence[float]], title: str, path: Path) -> Path:
    """Plot the remaining gain of each method over its simulations; returns the path of the PNG.

    The remaining gain is the distance of the best reward so far from the best of all methods, relative to its value for
    the worst first design.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 3.6), layout="constrained", dpi=130)
    axes = figure.subplots()
    top = max(curve[-1] for curve in best_so_far.values())
    total = max(top - min(curve[0] for curve in best_so_far.values()), 1e-30)
    for color, (name, curve) in zip(COLORS, best_so_far.items(), strict=False):
        remaining = np.maximum((top - np.asarray(curve)) / total, MIN_REMAINING_GAIN)
        axes.step(np.arange(1, len(curve) + 1), remaining, where="post", color=color, label=name)
    axes.set_yscale("log")
    axes.set_ylim(MIN_REMAINING_GAIN / 1.3, 1.3)
    axes.set_xlabel("simulations")
    axes.set_ylabel("remaining gain (relative)")
    axes.set_title(title)
    axes.legend(frameon=False)
    set_style(axes)
    with atomic_file(path) as partial:
        figure.savefig(partial, format="png")
    return path


def parameter_curves(run: DesignRun) -> dict[str, np.ndarray]:
    """Each parameter over the iterations: its elements if they are few, else its distance from the start."""
    curves: dict[str, np.ndarray] = {}
    for name, start in run.start.items():
        elements = np.stack([design[name].numpy() for design in run.designs]).reshape(len(run.designs), -1)
        if start.ndim == 0:
            curves[name] = elements[:, 0]
        elif start.numel() <= MAX_CURVES:
            curves |= {f"{name}.{number}": elements[:, number] for number in range(start.numel())}
        else:
            curves[f"distance of {name} from the start"] = np.linalg.norm(elements - elements[0], axis=1)
    return curves


def set_style(*plots: Axes) -> None:
    """Remove the box around each plot, add a light grid, and write numbers in full, without an offset."""
    for axes in plots:
        if axes.get_yscale() == "linear":
            axes.ticklabel_format(axis="y", useOffset=False)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
