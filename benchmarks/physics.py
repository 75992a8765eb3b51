"""Physics that is known: Archimedes' buoyancy, the pressure on a floor, the draught of a floating box.

    python benchmarks/physics.py [archimedes] [floor] [draught]

Each measurement simulates still water with particles of 15 mm, prints a row for each case, and writes
`benchmarks/results/physics_NAME.json` and `docs/images/physics-NAME.png`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from physics_results import DENSITY, GRAVITY, MARGIN, Row, level, picture, run, write
from surfsup.scene import PARTICLE_RADIUS, Scene
from surfsup.simulation import Simulation
from surfsup.simulation_state import Frame

SETTLING, AVERAGED = 300, 200  # frames: 1.5 s and 1 s
GAP = 0.02  # meters from walls to the block of water at the start, as in benchmarks/at_rest.py


def pool(
    side: float, depth: float, surfaces: Mapping[str, object], frames: int = SETTLING
) -> tuple[Simulation, list[Frame]]:
    """A simulation of a pool, and its frames after settling."""
    half = side / 2 - GAP
    scene = {
        "container": {"size": [side, side, 1.0]},
        "surfaces": dict(surfaces),
        "forces": "all",
        "fluid": [{"block": {"min": [-half, -half, GAP], "max": [half, half, depth]}}],
    }
    simulation = Simulation(Scene.from_yaml(json.dumps(scene), "the benchmark's scene", Path()))
    for _ in range(frames):
        simulation.step()
    return simulation, [simulation.step() for _ in range(AVERAGED)]


def archimedes() -> None:
    """The mean upward force on a held ball, as a share of the weight of the water in its place."""
    rows: list[Row] = []
    for radius in (0.07, 0.085, 0.1, 0.12):
        for flush in (False, True):
            ball = {"sphere": {"radius": radius}, "at": [0, 0, 0.2], "flush": flush}
            _, frames = pool(0.6, 0.42, {"ball": ball})
            forces = np.array([frame.forces["ball"].force[2] for frame in frames])
            displaced = DENSITY * GRAVITY * 4 / 3 * math.pi * radius**3
            ratio = float(forces.mean()) / displaced
            rows.append({"radius_m": radius, "flush": str(flush), "force_N": float(forces.mean()), "ratio": ratio})
            print(
                f"ball of {radius:g} m, flush {flush}: {forces.mean():.1f} N, {ratio:.3f} of the displaced weight",
                flush=True,
            )

    def draw(axes: Axes) -> None:
        for flush, color, label in (("False", "tab:blue", "as it is"), ("True", "tab:orange", "flush")):
            chosen = [row for row in rows if row["flush"] == flush]
            sizes = [float(row["radius_m"]) / PARTICLE_RADIUS for row in chosen]
            axes.plot(sizes, [float(row["ratio"]) for row in chosen], "o", color=color, label=label)
        sizes = np.linspace(4, 20, 100)
        axes.plot(sizes, (1 + 1.3 / sizes) ** 3, color="tab:blue", linewidth=0.8, label="a gap of 1.3 particle radii")
        axes.axhspan(0.97, 1.03, color="0.9", zorder=0)
        axes.axhline(1, color="0.4", linewidth=0.8)
        axes.set_xlabel("radius of the ball / radius of a particle")
        axes.set_ylabel("force / displaced weight")
        axes.legend(frameon=False)

    picture("archimedes", draw)
    worst = max((row for row in rows if row["flush"] == "True"), key=lambda row: abs(float(row["ratio"]) - 1))
    write(
        "archimedes",
        "Mean force on a held ball that is flush, over the displaced weight, worst of four sizes",
        float(worst["ratio"]),
        "",
        rows,
    )


def floor() -> None:
    """The pressure on the floor of a pool over that of a column of water of the same height."""
    side, rows = 0.5, []
    for depth in (0.12, 0.2, 0.28, 0.36, 0.44, 0.64, 0.94):
        simulation, frames = pool(side, depth, {})
        force = -float(np.mean([frame.forces["container"].force[2] for frame in frames]))
        weight = len(simulation.particles.positions) * DENSITY * (2 * PARTICLE_RADIUS) ** 3 * GRAVITY
        gap = 1.3 * PARTICLE_RADIUS  # between the water and walls or floor
        height, area = level(frames, side) - gap, (side - 2 * gap) ** 2
        pressure, expected = force / area, DENSITY * GRAVITY * height
        rows.append(
            {
                "height_m": height,
                "pressure_Pa": pressure,
                "ratio": pressure / expected,
                "force_over_weight": force / weight,
            }
        )
        print(
            f"{height:.3f} m of water: {pressure:.0f} Pa, {pressure / expected:.3f} of ρ g h; "
            f"force {force / weight:.5f} of the weight",
            flush=True,
        )

    def draw(axes: Axes) -> None:
        axes.plot([row["height_m"] for row in rows], [row["pressure_Pa"] for row in rows], "o", label="measured")
        heights = np.array([0, max(row["height_m"] for row in rows)])
        axes.plot(heights, DENSITY * GRAVITY * heights, color="0.4", linewidth=0.8, label="ρ g h")
        axes.set_xlabel("height of the water, m")
        axes.set_ylabel("mean pressure on the floor, Pa")
        axes.legend(frameon=False)

    picture("floor", draw)
    worst = max(rows, key=lambda row: abs(row["ratio"] - 1))
    write("floor", "Mean pressure on a floor over ρ g h, worst of seven heights", worst["ratio"], "", rows)


def draught() -> None:
    """The draught of a box that floats freely, for several densities."""
    side, size = 0.6, (0.3, 0.3, 0.2)
    rows = []
    for density in (200, 300, 500, 700, 850):
        box = {"box": {"size": list(size)}, "at": [0, 0, 0.5], "rigid_body": {"density": density}}
        _, frames = pool(side, 0.36, {"box": box}, frames=2 * SETTLING)
        bottom = float(np.mean([frame.poses["box"].position[2] for frame in frames])) - size[2] / 2
        found, expected = level(frames, side, hole=size[0] / 2 + MARGIN) - bottom, size[2] * density / DENSITY
        tilt = max(math.degrees(math.acos(min(1.0, frame.poses["box"].matrix[2, 2]))) for frame in frames)
        rows.append({"density": density, "draught_m": found, "expected_m": expected, "tilt_degrees": tilt})
        print(
            f"{density} kg/m³: draught {found:.4f} m, expected {expected:.4f} m, tilt at most {tilt:.1f} degrees",
            flush=True,
        )

    def draw(axes: Axes) -> None:
        densities = [row["density"] for row in rows]
        axes.plot(densities, [1000 * row["draught_m"] for row in rows], "o", label="measured")
        axes.plot([0, 1000], [0, 1000 * size[2]], color="0.4", linewidth=0.8, label="Archimedes")
        axes.set_xlabel("density of the box, kg/m³")
        axes.set_ylabel("draught, mm")
        axes.legend(frameon=False)

    picture("draught", draw)
    worst = max(rows, key=lambda row: abs(row["draught_m"] - row["expected_m"]))
    error = 1000 * (worst["draught_m"] - worst["expected_m"])
    write(
        "draught",
        "Draught of a floating box 0.2 m high less the expected one, worst of five densities",
        error,
        "mm",
        rows,
    )


MEASUREMENTS = {"archimedes": archimedes, "floor": floor, "draught": draught}


if __name__ == "__main__":
    run(MEASUREMENTS)
