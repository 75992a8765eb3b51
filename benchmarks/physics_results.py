"""What the benchmarks of known physics share: the level of water, pictures and results."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from record import ROOT, write_result
from surfsup.scene import PARTICLE_RADIUS
from surfsup.simulation_state import Frame

GRAVITY, DENSITY = 9.81, 1000.0
MARGIN = 0.05  # meters from walls and bodies within which the level is not measured

Row = dict[str, float | str]


def level(frames: list[Frame], side: float, hole: float = 0.0) -> float:
    """Height of the surface in meters: half a spacing above the top layer, away from walls and a body in the middle."""
    heights = []
    for frame in frames[:: max(1, len(frames) // 20)]:
        across = np.abs(frame.positions[:, :2]).max(axis=1)
        heights.append(np.quantile(frame.positions[(across < side / 2 - MARGIN) & (across > hole), 2], 0.98))
    return float(np.mean(heights)) + PARTICLE_RADIUS


def picture(name: str, draw: Callable[[Axes], None]) -> None:
    """Write the picture of a measurement for the docs."""
    figure = Figure(figsize=(5.2, 3.4), layout="constrained", dpi=130)
    axes = figure.subplots()
    draw(axes)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(ROOT / "docs" / "images" / f"physics-{name}.png", metadata={"Software": None})


def write(name: str, claim: str, figure: float, unit: str, rows: list[Row] | list[dict[str, float]]) -> None:
    """Write the result of a measurement."""
    rounded = [{key: round(v, 5) if isinstance(v, float) else v for key, v in row.items()} for row in rows]
    command = f"python benchmarks/{Path(sys.argv[0]).name} {name}"
    write_result(f"physics_{name}", claim, round(figure, 3), unit, None, None, command, {"cases": rounded}, threads=1)


def run(measurements: Mapping[str, Callable[[], None]]) -> None:
    """Run the measurements that the arguments of the program name, or all."""
    torch.set_num_threads(1)
    if unknown := [name for name in sys.argv[1:] if name not in measurements]:
        sys.exit(f"there is no measurement '{unknown[0]}'; there are {', '.join(measurements)}")
    for name in sys.argv[1:] or measurements:
        measurements[name]()
