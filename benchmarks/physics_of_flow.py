"""Physics that is known of water that flows: communicating vessels, outflow, draining, a spinning bucket.

    python benchmarks/physics_of_flow.py [vessels] [outflow] [bucket]

Each measurement prints a row for each case, and writes `benchmarks/results/physics_NAME.json` and
`docs/images/physics-NAME.png`. `outflow` takes minutes, for its finest particles.
"""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from physics_results import GRAVITY, Row, picture, run, write
from surfsup.scene import Scene
from surfsup.simulation import Simulation

GAP = 1.3  # particle radii between the water and a solid


def simulation_of(scene: dict[str, object]) -> Simulation:
    """The simulation of a scene."""
    return Simulation(Scene.from_yaml(json.dumps(scene), "the benchmark's scene", Path()))


def vessels() -> None:
    """The levels of two vessels that a slot connects, filled to different heights at the start."""
    rows: list[Row] = []
    for opening in (0.08, 0.1, 0.12, 0.14, 0.16, 0.2):
        for narrow in (0.16, 0.4):
            wide, wall, depth = 0.4, 0.06, 0.3
            length = wide + wall + narrow
            middle = -length / 2 + wide + wall / 2
            scene = {
                "container": {"size": [length, depth, 1.0]},
                "surface": {"box": {"size": [wall, depth + 0.2, 1.0]}, "at": [middle, 0, 0.5 + opening]},
                "fluid": [
                    {"block": {"min": [-length / 2 + 0.02, -0.13, 0.02], "max": [middle - 0.05, 0.13, 0.5]}},
                    {"block": {"min": [middle + 0.05, -0.13, 0.02], "max": [length / 2 - 0.02, 0.13, 0.12]}},
                ],
            }
            simulation = simulation_of(scene)
            for _ in range(1800):
                simulation.step()
            frames = [simulation.step() for _ in range(200)][::10]
            levels = []
            for side in (-1, 1):
                heights = [f.positions[side * (f.positions[:, 0] - middle) > wall / 2, 2] for f in frames]
                levels.append(float(np.mean([np.quantile(z, 0.98) for z in heights])) + 0.015)
            rows.append(
                {
                    "opening_m": opening,
                    "width_m": narrow,
                    "level_left_m": levels[0],
                    "level_right_m": levels[1],
                    "difference_m": levels[0] - levels[1],
                }
            )
            print(
                f"opening of {opening:g} m, vessels of {wide:g} and {narrow:g} m: levels {levels[0]:.4f} and "
                f"{levels[1]:.4f} m, {1000 * (levels[0] - levels[1]):+.1f} mm",
                flush=True,
            )

    def draw(axes: Axes) -> None:
        for narrow, color in ((0.16, "tab:orange"), (0.4, "tab:blue")):
            chosen = [row for row in rows if row["width_m"] == narrow]
            axes.plot(
                [1000 * float(row["opening_m"]) for row in chosen],
                [1000 * float(row["difference_m"]) for row in chosen],
                "o",
                color=color,
                label=f"vessels of 0.4 and {narrow:g} m",
            )
        axes.axhspan(-15, 15, color="0.9", zorder=0)
        axes.axhline(0, color="0.4", linewidth=0.8)
        axes.set_ylim(-80, 80)
        axes.set_xlabel("height of the opening between the vessels, mm")
        axes.set_ylabel("difference of the levels, mm")
        axes.legend(frameon=False)

    picture("vessels", draw)
    wide_enough = [row for row in rows if float(row["opening_m"]) >= 0.14]
    worst = max(wide_enough, key=lambda row: abs(float(row["difference_m"])))
    claim = "Difference of the levels of two communicating vessels, worst of those with an opening of 0.14 m or more"
    write("vessels", claim, 1000 * float(worst["difference_m"]), "mm", rows)


SIDE, PLATE, THICKNESS, DEPTH = 0.5, 0.4, 0.04, 0.3  # meters: of the tank, where its floor is, of the floor, of water


def tank(hole: float, radius: float) -> dict[str, object]:
    """A tank whose floor has a square hole."""
    wide = SIDE + 0.2
    bar = (wide - hole) / 2
    bars: list[dict[str, object]] = []
    for sign in (-1, 1):
        offset = sign * (hole / 2 + bar / 2)
        bars.append({"box": {"size": [bar, wide, THICKNESS]}, "at": [offset, 0, PLATE + THICKNESS / 2]})
        bars.append({"box": {"size": [hole, bar, THICKNESS]}, "at": [0, offset, PLATE + THICKNESS / 2]})
    low, half = PLATE + THICKNESS + GAP * radius, SIDE / 2 - GAP * radius
    return {
        "container": {"size": [SIDE, SIDE, 1.0]},
        "particle_radius": radius,
        "surface": {"union": bars},
        "fluid": [{"block": {"min": [-half, -half, low], "max": [half, half, low + DEPTH]}}],
        "drains": [{"box": {"size": [SIDE, SIDE, 0.3]}}],
        "duration": 60,
    }


def drained(hole: float, radius: float) -> Row:
    """How fast water leaves the tank, and how long it takes."""
    simulation = simulation_of(tank(hole, radius))
    volume = (2 * radius) ** 3
    times, above, speeds = [], [], []
    while True:
        frame = simulation.step()
        place, velocity = frame.positions, frame.velocities
        inside = place[:, 2] > PLATE + THICKNESS
        if frame.time > 30 or inside.sum() * volume < 0.25 * SIDE * SIDE * DEPTH:
            break
        times.append(frame.time)
        above.append(inside.sum() * volume)
        surface = np.quantile(place[inside, 2], 0.98) + radius
        jet = (place[:, 2] < PLATE) & (place[:, 2] > PLATE - 2 * radius)
        if jet.sum() >= 3:
            fallen = 2 * GRAVITY * (surface - place[jet, 2])
            speeds.append((frame.time, float(np.sqrt((velocity[jet] ** 2).sum(axis=1) / fallen).mean())))
    time, left = np.array(times), np.array(above)
    # Torricelli: the root of the height falls at a constant rate, C a / A sqrt(g / 2).
    area = (SIDE - 2 * GAP * radius) ** 2
    used = (left < 0.9 * left[0]) & (left > 0.3 * left[0])
    rate = -np.polyfit(time[used], np.sqrt(left[used] / area), 1)[0]
    coefficient = rate * math.sqrt(2 / GRAVITY) * area / hole**2
    first, last = time[used][0], time[used][-1]
    speed = float(np.mean([value for at, value in speeds if first <= at <= last]))
    effective = coefficient * (hole / (hole - 2 * GAP * radius)) ** 2
    row: Row = {
        "hole_m": hole,
        "radius_m": radius,
        "speed_ratio": speed,
        "discharge": coefficient,
        "discharge_without_gap": effective,
        "seconds": float(last - first),
        "particles": len(simulation.particles.positions),
    }
    print(
        f"hole of {hole:g} m, particles of {radius:g} m: speed {speed:.3f} of Torricelli's, "
        f"discharge {coefficient:.3f}, {effective:.3f} without the gap; from 0.9 to 0.3 in {last - first:.2f} s",
        flush=True,
    )
    return row


def outflow() -> None:
    """The speed of the water below a hole over Torricelli's, and how fast the tank drains."""
    rows = [drained(hole, 0.015) for hole in (0.12, 0.16, 0.2, 0.24)]
    rows += [drained(0.16, radius) for radius in (0.02, 0.01, 0.0075)]

    def draw(axes: Axes) -> None:
        sizes = [float(row["hole_m"]) / float(row["radius_m"]) for row in rows]
        for key, label in (
            ("speed_ratio", "speed / √(2 g h)"),
            ("discharge", "discharge coefficient"),
            ("discharge_without_gap", "the same of the hole less the gap"),
        ):
            axes.plot(sizes, [float(row[key]) for row in rows], "o", label=label)
        axes.axhline(1, color="0.4", linewidth=0.8)
        axes.axhspan(0.6, 0.65, color="0.9", zorder=0)
        axes.set_ylim(0, 1.1)
        axes.set_xlabel("side of the hole / radius of a particle")
        axes.legend(frameon=False)

    picture("outflow", draw)
    finest = min(rows, key=lambda row: float(row["radius_m"]))
    claim = "Speed of the water below a hole in a tank over Torricelli's, hole of 21 particle radii"
    write("outflow", claim, float(finest["speed_ratio"]), "", rows)


def bucket() -> None:
    """The parabola of the surface of water in a square bucket that spins."""
    rows: list[Row] = []
    rings: dict[float, tuple[np.ndarray, np.ndarray]] = {}
    side, depth = 0.6, 0.25
    for rate in (2.0, 3.0, 4.0, 5.0):
        half = side / 2 - 0.02
        scene = {
            "container": {"size": [side, side, 1.0], "motion": {"spin": {"rate": rate}}},
            "fluid": [{"block": {"min": [-half, -half, 0.02], "max": [half, half, depth]}}],
        }
        simulation = simulation_of(scene)
        for _ in range(1200):
            simulation.step()
        frames = [simulation.step() for _ in range(200)][::10]
        place = np.concatenate([frame.positions for frame in frames])
        velocity = np.concatenate([frame.velocities for frame in frames])
        radial = np.hypot(place[:, 0], place[:, 1])
        spin = (place[:, 0] * velocity[:, 1] - place[:, 1] * velocity[:, 0]).sum() / (radial**2).sum()
        edges = np.linspace(0, side / 2, 8)
        middles, heights = [], []
        for inner, outer in pairwise(edges):
            ring = (radial >= inner) & (radial < outer)
            middles.append(math.sqrt((inner**2 + outer**2) / 2))
            heights.append(np.quantile(place[ring, 2], 0.97))
        middle, height = np.array(middles), np.array(heights)
        slope = np.polyfit(middle**2, height, 1)[0]
        expected, edge = rate**2 / (2 * GRAVITY), (side / 2) ** 2
        rings[rate] = middle, height
        rows.append(
            {
                "rate": rate,
                "water_rate": float(spin),
                "rise_m": float(slope) * edge,
                "expected_m": expected * edge,
                "error_m": (float(slope) - expected) * edge,
            }
        )
        print(
            f"{rate:g} rad/s: the water turns at {spin:.3f} rad/s, and rises by {1000 * slope * edge:.1f} mm to the "
            f"middle of a wall, expected {1000 * expected * edge:.1f}",
            flush=True,
        )

    def draw(axes: Axes) -> None:
        for number, (rate, (middle, height)) in enumerate(rings.items()):
            axes.plot(middle, height, "o", color=f"C{number}", label=f"{rate:g} rad/s")
            radius = np.linspace(0, side / 2, 50)
            curve = rate**2 / (2 * GRAVITY) * radius**2
            offset = float(np.mean(height - rate**2 / (2 * GRAVITY) * middle**2))
            axes.plot(radius, curve + offset, color=f"C{number}", linewidth=0.8)
        axes.set_xlabel("distance from the axis, m")
        axes.set_ylabel("height of the surface, m")
        axes.legend(frameon=False)

    picture("bucket", draw)
    worst = max(rows, key=lambda row: abs(float(row["error_m"])))
    claim = "Rise of the water in a square bucket that spins less ω² r² / 2 g, worst of four rates"
    write("bucket", claim, 1000 * float(worst["error_m"]), "mm", rows)


MEASUREMENTS = {"vessels": vessels, "outflow": outflow, "bucket": bucket}


if __name__ == "__main__":
    run(MEASUREMENTS)
