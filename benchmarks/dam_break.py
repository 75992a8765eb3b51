"""The front of a collapsing column of water beside the experiment of Martin and Moyce, for several particle sizes.

    python benchmarks/dam_break.py [--radii 0.015 0.010 0.0075]

A column of water, 0.24 m wide and twice as high, comes to rest in a container of its own width and is then released
into a long one. The front is the mean place of the particles nearest to the far wall, plus a radius, one for each
particle across the channel. The experiment: J. C. Martin and W. J. Moyce, "Part IV. An experimental study of the
collapse of liquid columns on a rigid horizontal plane", Philosophical Transactions of the Royal Society A 244, 1952,
table 2, n² = 2. SPlisHSPlasH cannot start from the settled column, which is closer to the walls than it allows.

The result is written to `benchmarks/results/dam_break.json`.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from record import write_result
from surfsup.scene import Block, Container, ParticleFile, Scene
from surfsup.simulation import Simulation

WIDTH, DEPTH, LENGTH = 0.24, 0.24, 1.5  # meters: of the column, of the channel, and of the channel's length
GRAVITY = 9.81
FPS = 100.0  # of the trajectory; every radius has the same times
# Table 2 of the experiment: t √(n² g / a), and the front over the column's width a.
TIMES = [0.41, 0.84, 1.19, 1.43, 1.63, 1.83, 1.98, 2.20, 2.32, 2.51, 2.65, 2.83, 2.98, 3.11, 3.33]
FRONTS = [1.11, 1.22, 1.44, 1.67, 1.89, 2.11, 2.33, 2.56, 2.78, 3.00, 3.22, 3.44, 3.67, 3.89, 4.11]

Row = dict[str, object]


def column_at_rest(radius: float) -> np.ndarray:
    """Positions (N, 3) of the settled column, about twice as high as wide; its left wall is at x = -WIDTH / 2."""
    layers = round(2 * WIDTH / (2 * radius))
    column = settled_column(radius, layers)
    # Water keeps a distance from the walls, so the first column is too high.
    return settled_column(radius, round(layers * 2 * WIDTH / height_of(column, radius)))


def settled_column(radius: float, layers: int) -> np.ndarray:
    """Positions (N, 3) of a column of that many layers at rest between its walls."""
    spacing = 2 * radius
    sites = [max(1, round(side / spacing - 1)) for side in (WIDTH, DEPTH)]
    low = [-(count + 1) * spacing / 2 for count in sites]
    corner = (-low[0] + 1e-4 * spacing, -low[1] + 1e-4 * spacing, (layers + 1.6) * spacing)
    block = Block((low[0], low[1], 0.5 * spacing), corner)
    container = Container(size=(WIDTH, DEPTH, 3.5 * WIDTH))
    scene = Scene(fluid=[block], container=container, particle_radius=radius, duration=2.0, fps=10)
    *_, last = Simulation(scene, device="cpu").run()
    return last.positions


def height_of(column: np.ndarray, radius: float) -> float:
    """Height in meters of the water with particles at (N, 3)."""
    return float(np.quantile(column[:, 2], 0.995)) + radius


def released(column: np.ndarray, radius: float, folder: Path) -> Scene:
    """The scene in which the settled column collapses."""
    file = folder / "column.npy"
    np.save(file, column + np.float32([(WIDTH - LENGTH) / 2, 0, 0]))
    return Scene(
        fluid=[ParticleFile(file=file)],
        container=Container(size=(LENGTH, DEPTH, 3 * WIDTH)),
        particle_radius=radius,
        duration=0.45,
        fps=min(FPS, 1 / (0.005 * (radius / 0.015) ** 0.5)),
    )


def fronts(frames: Iterable[np.ndarray], radius: float) -> np.ndarray:
    """The front over the column's width in each frame of positions (N, 3)."""
    across = round(DEPTH / (2 * radius))
    return np.array([np.sort(frame[:, 0])[-across:].mean() + radius + LENGTH / 2 for frame in frames]) / WIDTH


def compare(positions: list[np.ndarray], scene: Scene) -> Row:
    """The front at the times of the experiment, and its mean relative deviation."""
    radius = scene.particle_radius
    height = height_of(positions[0], radius)
    times = scene.frame_time * np.arange(len(positions)) * np.sqrt(height / WIDTH * GRAVITY / WIDTH)
    front = np.interp(TIMES, times, fronts(positions, radius))
    deviation = float(np.abs(front / FRONTS - 1).mean())
    row: Row = {
        "radius_m": radius,
        "particles": len(positions[0]),
        "column_height_over_width": round(height / WIDTH, 3),
        "front_over_width": front.round(3).tolist(),
        "mean_deviation": round(deviation, 4),
        "mean_lead": round(float((front / FRONTS - 1).mean()), 4),
    }
    print(
        f"radius {1000 * radius:g} mm, {len(positions[0])} particles: {100 * deviation:.1f} % from the "
        f"experiment on average, front at {front[-1]:.2f} column widths instead of {FRONTS[-1]:.2f}",
        flush=True,
    )
    return row


def main() -> None:
    """Measure, print and write the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--radii", type=float, nargs="+", default=[0.015, 0.010, 0.0075], help="meters")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for radius in arguments.radii:
            scene = released(column_at_rest(radius), radius, Path(folder))
            frames = [frame.positions for frame in Simulation(scene, device="cpu").run()]
            rows.append(compare(frames, scene))
    write_result(
        name="dam_break",
        claim=f"Deviation of a dam break's front from Martin and Moyce, particles of {1000 * arguments.radii[-1]:g} mm",
        figure=round(100 * float(str(rows[-1]["mean_deviation"])), 1),
        unit="%",
        peer=None,
        peer_figure=None,
        command="python benchmarks/dam_break.py",
        values={"times": TIMES, "experiment": FRONTS, "runs": rows},
        threads=1,
    )


if __name__ == "__main__":
    main()
