"""What a textbook knows of viscous liquids and of drops, and what the solver makes of it; see docs/physics.md.

    python benchmarks/physics_of_liquids.py [duct] [drop]

Each measurement runs scenes with particles of 15 mm, prints a row for each case, and writes
`benchmarks/results/physics_NAME.json` and `docs/images/physics-NAME.png`.
"""

from __future__ import annotations

import json
import math

import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import curve_fit

from physics_results import DENSITY, GRAVITY, picture, run, write
from surfsup.scene import PARTICLE_RADIUS, InitialParticles, Scene
from surfsup.simulation import Simulation

SETTLING = 300  # frames
RELAXING, OSCILLATING = 0.2, 0.002  # m²/s while a drop comes to rest, and while it oscillates


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


MEASUREMENTS = {"duct": duct, "drop": drop}


if __name__ == "__main__":
    run(MEASUREMENTS)
