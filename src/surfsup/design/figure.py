"""Reward and parameters over the iterations, as figures 7 and 8 of the SURFSUP supplement show them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surfsup.design.run import DesignRun
from surfsup.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLORS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple", "tab:brown")
STYLES = ("-", "--", ":", "-.", (0, (5, 1)), (0, (1, 1)))
NEAREST = 1e-4  # share left to gain that a figure of searches still shows
MOST_CURVES = len(COLORS)


def require_matplotlib() -> None:
    """Refuse early where no figure can be drawn.

    Raises:
        InputError: matplotlib is not installed.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise InputError("matplotlib is not installed; install it with: pip install 'surfsup[design]'") from None


def draw_runs(runs: Sequence[DesignRun], path: Path) -> Path:
    """Reward above, parameters below, over the iterations of all runs of one task; returns the PNG's path."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 6.0), layout="constrained", dpi=130)
    above, below = figure.subplots(2, 1, sharex=True)
    for number, run in enumerate(runs):
        style = STYLES[number % len(STYLES)]
        above.plot(run.rewards, color="0.15", linestyle=style)
        for color, (name, curve) in zip(COLORS, curves(run).items(), strict=False):
            label = name if number == 0 else None
            below.plot(curve, color=color, linestyle=style, label=label)
    above.set_ylabel("reward (mean log density)" if runs[0].task.name in ("bowl", "funnel") else "reward")
    below.set_ylabel("parameter")
    below.set_xlabel("iteration")
    below.legend(frameon=False)
    tidy(above, below)
    above.set_title(f"{runs[0].task.name}: {len(runs)} start{'s' if len(runs) > 1 else ''}, model '{runs[0].model}'")
    figure.savefig(path)
    return path


def draw_rivals(best_so_far: Mapping[str, Sequence[float]], title: str, path: Path) -> Path:
    """How far the best reward so far is from the best of all, over the simulations, one curve a method; returns the
    PNG's path. A share of 1 is where the worst of the curves begins.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 3.6), layout="constrained", dpi=130)
    axes = figure.subplots()
    top = max(curve[-1] for curve in best_so_far.values())
    range_ = max(top - min(curve[0] for curve in best_so_far.values()), 1e-30)
    for color, (name, curve) in zip(COLORS, best_so_far.items(), strict=False):
        short = np.maximum((top - np.asarray(curve)) / range_, NEAREST)
        axes.step(np.arange(1, len(curve) + 1), short, where="post", color=color, label=name)
    axes.set_yscale("log")
    axes.set_ylim(NEAREST / 1.3, 1.3)
    axes.set_xlabel("simulations")
    axes.set_ylabel("share that is left to gain")
    axes.set_title(title)
    axes.legend(frameon=False)
    tidy(axes)
    figure.savefig(path)
    return path


def curves(run: DesignRun) -> dict[str, np.ndarray]:
    """The parameters over the iterations: each number where they are few, else how far all of one name have moved."""
    found: dict[str, np.ndarray] = {}
    for name, start in run.start.items():
        course = np.stack([design[name].numpy() for design in run.designs]).reshape(len(run.designs), -1)
        if start.ndim == 0:
            found[name] = course[:, 0]
        elif start.numel() <= MOST_CURVES:
            found |= {f"{name}.{number}": course[:, number] for number in range(start.numel())}
        else:
            found[f"distance of {name} from the start"] = np.linalg.norm(course - course[0], axis=1)
    return found


def tidy(*every: Axes) -> None:
    """No box around a plot, and a quiet grid."""
    for axes in every:
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(alpha=0.25)
