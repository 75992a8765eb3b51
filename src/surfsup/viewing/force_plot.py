"""A plot of forces and torques on solids over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from surfsup.errors import InputError
from surfsup.io.atomic_file import atomic_file
from surfsup.io.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AXES = (("x", "tab:red"), ("y", "tab:green"), ("z", "tab:blue"))
WINDOW = 0.1  # seconds: the thick lines are means over it


def plot_forces(trajectory: Trajectory, names: Sequence[str], path: Path) -> None:
    """Write a PNG with a row for each solid: force on the left, torque on the right.

    Raises:
        InputError: matplotlib is not installed, or the file cannot be written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError(
            "matplotlib is not installed, which the plot needs; install it with: pip install matplotlib"
        ) from None
    time = trajectory.start_time + np.arange(len(trajectory)) * trajectory.frame_time
    window = max(1, round(WINDOW / trajectory.frame_time))
    figure = Figure(figsize=(9.0, 0.8 + 2.4 * len(names)), layout="constrained", dpi=130)
    rows = figure.subplots(len(names), 2, sharex=True, squeeze=False)
    for name, (left, right) in zip(names, rows, strict=True):
        plot_components(left, time, trajectory.forces[name], window)
        plot_components(right, time, trajectory.torques[name], window)
        left.set_ylabel("force, N")
        right.set_ylabel("torque, N m")
        left.set_title(name, loc="left")
    for bottom in rows[-1]:
        bottom.set_xlabel("time, s")
    rows[0, 1].legend(*rows[0, 0].get_legend_handles_labels(), frameon=False, loc="upper right", ncols=3)
    try:
        with atomic_file(path) as partial:
            figure.savefig(partial, format=path.suffix.removeprefix(".") or "png", metadata={"Software": None})
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None


def plot_components(axes: Axes, time: np.ndarray, values: np.ndarray, window: int) -> None:
    """Plot the components of ``values`` (frames, 3), and on top of each its moving mean over ``window`` frames."""
    for component, (label, color) in enumerate(AXES):
        curve = values[:, component]
        axes.plot(time, curve, color=color, linewidth=0.4, alpha=0.5)
        known = ~np.isnan(curve)
        if known.sum() >= window:
            mean = np.convolve(curve[known], np.full(window, 1 / window), mode="valid")
            first = (window - 1) // 2
            axes.plot(time[known][first : first + len(mean)], mean, color=color, linewidth=1.2, label=label)
    axes.spines[["top", "right"]].set_visible(False)
    axes.axhline(0, color="0.7", linewidth=0.5, zorder=0)
