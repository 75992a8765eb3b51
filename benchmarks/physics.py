"""Physics that is known: Archimedes' buoyancy, the pressure on a floor, the draught of a floating box.

    python benchmarks/physics.py [archimedes] [floor] [draught]

Each measurement simulates still water with particles of 15 mm, prints a row for each case, and writes
`benchmarks/results/physics_NAME.json` and `docs/images/physics-NAME.png`.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import curve_fit

from record import ROOT, write_result
from surfsup.scene import PARTICLE_RADIUS, InitialParticles, Scene
from surfsup.simulation import Frame, Simulation

GRAVITY, DENSITY = 9.81, 1000.0
SETTLING, AVERAGED = 300, 200  # frames: 1.5 s and 1 s
GAP = 0.02  # meters from walls to the block of water at the start, as in benchmarks/at_rest.py
MARGIN = 0.05  # meters from walls and bodies within which the level is not measured

Row = dict[str, float | str]


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


def level(frames: list[Frame], side: float, hole: float = 0.0) -> float:
    """Height of the surface in meters: half a spacing above the top layer, away from walls and a body in the middle."""
    heights = []
    for frame in frames[:: max(1, len(frames) // 20)]:
        across = np.abs(frame.positions[:, :2]).max(axis=1)
        heights.append(np.quantile(frame.positions[(across < side / 2 - MARGIN) & (across > hole), 2], 0.98))
    return float(np.mean(heights)) + PARTICLE_RADIUS


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
    for depth in (0.12, 0.2, 0.28, 0.36, 0.44):
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
    write("floor", "Mean pressure on a floor over ρ g h, worst of five heights", worst["ratio"], "", rows)


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
    command = f"python benchmarks/physics.py {name}"
    write_result(f"physics_{name}", claim, round(figure, 3), unit, None, None, command, {"cases": rounded}, threads=1)


def duct() -> None:
    """The mean speed of a viscous liquid that falls in a square duct, over that of a Poiseuille flow."""
    rows = []
    for side, viscosity in ((0.24, 0.3), (0.3, 0.5), (0.39, 0.8)):
        start = disordered_column(side)
        scene = {
            "container": {"size": [side, side, 4.0]},
            "fluid": [{"block": {"min": [-0.05, -0.05, 1], "max": [0.05, 0.05, 1.1]}}],
            "liquid": {"viscosity": viscosity},
        }
        simulation = Simulation(
            Scene.from_yaml(json.dumps(scene), "the benchmark's scene"),
            particles=InitialParticles([start + np.float32([0, 0, 1.5])], [(0.0, 0.0, 0.0)], 0),
        )
        frames = [simulation.step() for _ in range(40)][20:]
        places, speeds = [], []
        for frame in frames:
            height = frame.positions[:, 2]
            middle = np.abs(height - np.median(height)) < 0.15
            places.append(frame.positions[middle])
            speeds.append(-frame.velocities[middle, 2])
        place, speed = np.concatenate(places), np.concatenate(speeds)
        expected = duct_flow(place[:, 0], place[:, 1], side, viscosity)
        rows.append(
            {
                "side_m": side,
                "viscosity": viscosity,
                "side_over_radius": side / PARTICLE_RADIUS,
                "mean_speed": float(speed.mean()),
                "ratio": float(speed.mean() / expected.mean()),
                "profile": profile(place, speed, side),
            }
        )
        print(
            f"duct of {side:g} m, {viscosity:g} m²/s: {speed.mean():.4f} m/s, {rows[-1]['ratio']:.3f} of the exact one"
        )

    def draw(axes: Axes) -> None:
        for row, color in zip(rows, ("tab:blue", "tab:orange", "tab:green"), strict=True):
            side, viscosity = float(row["side_m"]), float(row["viscosity"])
            across = np.linspace(-side / 2, side / 2, 101)
            scale = float(duct_flow(np.zeros(1), np.zeros(1), side, viscosity)[0])
            exact = duct_flow(across, np.zeros_like(across), side, viscosity)
            axes.plot(2 * across / side, exact / scale, color="0.4", linewidth=0.8)
            points = np.array(row["profile"])
            label = f"{side / PARTICLE_RADIUS:.0f} particle radii wide"
            axes.plot(2 * points[:, 0] / side, points[:, 1] / scale, "o", ms=4, color=color, label=label)
        axes.set_xlabel("place across the middle of the duct / half its width")
        axes.set_ylabel("speed / exact speed in the middle")
        axes.legend(frameon=False, loc="lower center")

    picture("duct", draw)
    worst = max(rows, key=lambda row: abs(row["ratio"] - 1))
    claim = "Mean speed of a viscous liquid that falls in a square duct, over the exact one, worst of three sizes"
    write("duct", claim, worst["ratio"], "", rows)


def disordered_column(side: float, height: float = 1.0) -> np.ndarray:
    """Water at rest in a square container, in no lattice: positions (N, 3), meters."""
    count = int((side - 0.04) / (2 * PARTICLE_RADIUS))
    across = 2 * PARTICLE_RADIUS * (np.arange(count) - (count - 1) / 2)
    upward = 0.04 + 2 * PARTICLE_RADIUS * np.arange(round(height / (2 * PARTICLE_RADIUS)))
    lattice = np.stack(np.meshgrid(across, across, upward, indexing="ij"), axis=-1).reshape(-1, 3)
    random = np.random.default_rng(0)
    start = (lattice + random.normal(scale=0.003, size=lattice.shape)).astype(np.float32)
    scene = {
        "container": {"size": [side, side, height + 1]},
        "fluid": [{"block": {"min": [-0.05, -0.05, 1], "max": [0.05, 0.05, 1.1]}}],
    }
    velocities = random.normal(scale=1.5, size=start.shape).astype(np.float32)
    simulation = Simulation(
        Scene.from_yaml(json.dumps(scene), "the benchmark's scene"),
        particles=InitialParticles([start], [velocities], 0),
    )
    for _ in range(SETTLING):
        frame = simulation.step()
    return frame.positions


def duct_flow(x: np.ndarray, y: np.ndarray, side: float, viscosity: float) -> np.ndarray:
    """Speed of a liquid that falls in a square duct at points (N,), m/s: the Poiseuille flow of a rectangle.

    F. M. White, "Viscous Fluid Flow", section 3-3.
    """
    total = np.zeros_like(x, dtype=float)
    for n in range(1, 60, 2):
        k = n * math.pi / side
        # cosh(k y) / cosh(k side / 2), without its overflow
        part = (np.exp(k * (np.abs(y) - side / 2)) + np.exp(-k * (np.abs(y) + side / 2))) / (1 + math.exp(-k * side))
        total += (-1) ** ((n - 1) // 2) / n**3 * (1 - part) * np.cos(k * x)
    return 4 * GRAVITY * side**2 / (viscosity * math.pi**3) * np.maximum(total, 0)


def profile(places: np.ndarray, speeds: np.ndarray, side: float) -> list[list[float]]:
    """Place across the middle of a duct and mean speed there, in bins half a spacing wide."""
    middle = np.abs(places[:, 1]) < 2 * PARTICLE_RADIUS
    edges = np.arange(-side / 2, side / 2 + PARTICLE_RADIUS, PARTICLE_RADIUS)
    bins = np.digitize(places[middle, 0], edges)
    found = []
    for number in np.unique(bins):
        chosen = bins == number
        if chosen.sum() > 5:
            found.append([float(places[middle, 0][chosen].mean()), float(speeds[middle][chosen].mean())])
    return found


def drop() -> None:
    """The period of a drop that oscillates, over Rayleigh's, for drops of several sizes and tensions."""
    rows = []
    for radius, tension in ((0.1, 80.0), (0.12, 80.0), (0.15, 80.0), (0.18, 80.0), (0.15, 40.0), (0.15, 160.0)):
        times, shape, size = oscillation(radius, tension)
        expected = 2 * math.pi * math.sqrt(DENSITY * size**3 / (8 * tension))
        period, damping = fitted_period(times, shape, expected)
        rows.append(
            {
                "radius_m": size,
                "radius_over_particle": size / PARTICLE_RADIUS,
                "tension": tension,
                "period_s": period,
                "rayleigh_s": expected,
                "ratio": period / expected,
                "damping": damping,
            }
        )
        print(
            f"drop of {size:.3f} m, {tension:g} N/m: {period:.3f} s, {period / expected:.3f} of Rayleigh's; "
            f"damping {damping:.2f} 1/s, of viscosity alone {5 * OSCILLATING / size**2:.2f}",
            flush=True,
        )

    def draw(axes: Axes) -> None:
        for tension, color in ((40.0, "tab:green"), (80.0, "tab:blue"), (160.0, "tab:orange")):
            chosen = [row for row in rows if row["tension"] == tension]
            radii = [row["radius_over_particle"] for row in chosen]
            axes.plot(radii, [row["ratio"] for row in chosen], "o", color=color, label=f"{tension:g} N/m")
        axes.axhspan(0.9, 1.1, color="0.9", zorder=0)
        axes.axhline(1, color="0.4", linewidth=0.8)
        axes.set_xlabel("radius of the drop / radius of a particle")
        axes.set_ylabel("period / Rayleigh's period")
        axes.legend(frameon=False)

    picture("drop", draw)
    worst = max(rows, key=lambda row: abs(row["ratio"] - 1))
    write("drop", "Period of an oscillating drop over Rayleigh's, worst of six drops", worst["ratio"], "", rows)


RELAXING, OSCILLATING = 0.2, 0.002  # m²/s while a drop comes to rest, and while it oscillates


def oscillation(radius: float, tension: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Times (K,) in s, deviations from a ball (K,) of a drop that was pushed, and its radius by volume in m.

    The deviation is the second moment along z less those across, over their sum. The drop is in three dimensions.
    """
    fluid = [{"fill": {"surface": {"sphere": {"radius": radius}}}}]
    liquid = {"viscosity": RELAXING, "surface_tension": tension}
    scene = {"container": "none", "gravity": [0, 0, 0], "fluid": fluid, "liquid": liquid}
    simulation = Simulation(Scene.from_yaml(json.dumps(scene), "the benchmark's scene"))
    for _ in range(150):
        frame = simulation.step()
    places = frame.positions - frame.positions.mean(axis=0)
    size = 2 * PARTICLE_RADIUS * (len(places) * 3 / (4 * math.pi)) ** (1 / 3)
    rate = 0.15 * math.sqrt(8 * tension / (DENSITY * size**3))
    push = (places * np.float32([-0.5, -0.5, 1]) * rate).astype(np.float32)
    liquid["viscosity"] = OSCILLATING
    simulation = Simulation(
        Scene.from_yaml(json.dumps(scene), "the benchmark's scene"), particles=InitialParticles([places], [push], 0)
    )
    times, shape = [], []
    for _ in range(400):
        frame = simulation.step()
        moments = ((frame.positions - frame.positions.mean(axis=0)) ** 2).mean(axis=0)
        shape.append((moments[2] - (moments[0] + moments[1]) / 2) / moments.sum())
        times.append(frame.time)
    return np.array(times), np.array(shape), size


def fitted_period(times: np.ndarray, values: np.ndarray, near: float) -> tuple[float, float]:
    """Period without damping in s, and damping in 1/s, of a damped oscillation with a period ``near`` this one."""

    def wave(t: np.ndarray, a: float, b: float, w: float, phase: float, rest: float) -> np.ndarray:
        return a * np.exp(-b * t) * np.sin(w * t + phase) + rest

    rate, size = 2 * math.pi / near, np.abs(values).max()
    bounds = ([0, 0, rate / 2, -1.5, -size], [9 * size, 5 * rate, 2 * rate, 1.5, size])
    best, least = np.zeros(5), math.inf
    for factor in (0.7, 1.0, 1.4):
        found, _ = curve_fit(wave, times, values, [size, 0.2 * rate, factor * rate, 0.0, 0.0], bounds=bounds)
        error = float(((wave(times, *found) - values) ** 2).sum())
        if error < least:
            best, least = found, error
    return 2 * math.pi / math.hypot(best[1], best[2]), float(best[1])


MEASUREMENTS = {"archimedes": archimedes, "floor": floor, "draught": draught, "duct": duct, "drop": drop}


def main() -> None:
    """Run the measurements that the arguments name, or all."""
    torch.set_num_threads(1)
    if unknown := [name for name in sys.argv[1:] if name not in MEASUREMENTS]:
        sys.exit(f"there is no measurement '{unknown[0]}'; there are {', '.join(MEASUREMENTS)}")
    for name in sys.argv[1:] or MEASUREMENTS:
        MEASUREMENTS[name]()


if __name__ == "__main__":
    main()
