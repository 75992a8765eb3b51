"""The frontier of error over time without learning: the solver with larger frames and fewer substeps.

    python benchmarks/frontier.py data/validation [--frames 800] [--plot docs/images/frontier.png]

The folder is a data set with floors (`surfsup floor`), never a test set: the defaults of the solver are chosen from it.
For each pair of frame time and substeps, for long steps (`simulate --fast`, zero substeps in the result) and for
particles twice as large, the program simulates every scene on one thread and compares it with the reference at the same
times, every 20 ms:

- simulated seconds in a second of the processor,
- Chamfer distance over the floor's: mean, and at 0.3, 0.5 and 1 s,
- largest difference of the center's height, mean difference of the kinetic energy over its mean,
- largest density over that of the reference,
- speed and height of a pool 0.3 m deep after 10 s.

With particles twice as large Chamfer distances mean nothing; the density field on a grid of 6 cm is compared instead,
for all settings. The result is written to `benchmarks/results/frontier.json`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import torch

from at_rest import root_mean_square_speed, scene_of
from record import write_result
from surfsup.evaluation.floor import floor_files
from surfsup.evaluation.metrics import center_height, chamfer, kd_tree, kinetic_energy, max_density
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_path import trajectory_files
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Scene
from surfsup.scene.solids import Solids, build_solids
from surfsup.simulation import Simulation
from surfsup.sph.environment import Environment
from surfsup.sph.long_step_solver import LongStepSolver
from surfsup.sph.native_solver import NativeSolver
from surfsup.sph.solver import finished
from surfsup.sph.state import FramePart, ParticleState

STRIDE = 4  # frames of the reference between comparisons: 20 ms
MOMENTS = (60, 100, 200)  # frames
CELL = 0.06  # meters, of the density field
POOL_SECONDS = 10.0
SETTINGS = [(5, 1), (5, 2), (5, 3), (5, 4), (5, 5), (5, 7), (10, 2), (10, 3), (10, 5), (10, 10), (20, 4), (20, 10)]
LONG_STEPS = (20, 0)  # of `--fast`, which chooses the substeps itself
DEFAULT = (5, 5)  # frame in ms, substeps
COARSE_RADIUS = 0.03  # meters


Moment = tuple[np.ndarray, np.ndarray, float]  # positions, velocities, and the processor's seconds so far


@dataclass(frozen=True)
class Row:
    """The measurements of one setting; see the module's docstring."""

    frame_ms: int
    substeps: int
    radius_mm: float
    simulated_seconds: float
    chamfer: float
    chamfer_at: list[float]
    height_mm: float
    energy: float
    density: float
    density_field: float
    inside: int
    pool_speed_mm_s: float
    pool_height_mm: float


@dataclass
class Curves:
    """One value for every moment of a scene."""

    chamfer: list[float] = field(default_factory=list)
    density_field: list[float] = field(default_factory=list)
    height: list[float] = field(default_factory=list)
    energy: list[float] = field(default_factory=list)
    density: list[float] = field(default_factory=list)


def rollout(
    scene: Scene, positions: np.ndarray, velocities: np.ndarray, part: FramePart, count: int
) -> Iterator[Moment]:
    """The state every 20 ms, by frames of other length and other substeps, or by long steps."""
    environment = Environment.of(scene, scene.build_surface())
    state = ParticleState(torch.from_numpy(positions), torch.from_numpy(velocities))
    solver, long_steps, spent = NativeSolver(), LongStepSolver(), 0.0
    frames = round(STRIDE * FRAME_TIME / part.seconds)
    yield positions, velocities, spent
    for moment in range(1, count):
        for _ in range(frames):
            began = time.process_time()
            if part.substeps == 0:
                state, _ = long_steps.long_step(state, environment)
            else:
                state, _ = finished(state, solver.step(state, environment, True, part), environment, True, part)
            spent += time.process_time() - began if moment > 1 else 0.0  # the first 20 ms include the setup
        yield state.positions.numpy(), state.velocities.numpy(), spent


def coarse_rollout(scene: Scene, count: int) -> Iterator[Moment]:
    """The state every 20 ms, by the default solver with particles twice as large."""
    simulation = Simulation(scene.with_changes(particle_radius=COARSE_RADIUS), device="cpu")
    began, spent = time.process_time(), 0.0
    frames = simulation.run((count - 0.5) * STRIDE * FRAME_TIME, 1 / (STRIDE * FRAME_TIME))
    for moment, frame in enumerate(frames):
        spent += time.process_time() - began if moment > 1 else 0.0
        yield frame.positions, frame.velocities, spent
        began = time.process_time()


def density_field(positions: np.ndarray, scene: Scene, radius: float) -> np.ndarray:
    """Volume of water in every node of the grid, relative to a cell, by linear weights (cloud in cell)."""
    lower, upper = np.array(scene.container.lower), np.array(scene.container.upper)
    nodes = np.ceil((upper - lower) / CELL).astype(int) + 1
    place = np.clip((positions - lower) / CELL, 0, nodes - 1 - 1e-6)
    corner = np.floor(place).astype(int)
    part = place - corner
    grid = np.zeros(nodes)
    for shift in np.ndindex(2, 2, 2):
        weights = np.prod(np.where(np.array(shift) == 1, part, 1 - part), axis=1)
        np.add.at(grid, tuple((corner + shift).T), weights)
    return grid * (2 * radius / CELL) ** 3


def compare(
    reference: Trajectory, frames: Iterator[Moment], count: int, radius: float, solids: Solids
) -> tuple[Curves, float, int]:
    """The curves of a rollout against the reference, its processor's time, and particles inside the solid in all."""
    curves, spent, inside = Curves(), 0.0, 0
    for moment, (positions, velocities, spent_so_far) in zip(range(count), frames, strict=False):
        spent = spent_so_far
        theirs = reference.positions[moment * STRIDE]
        if radius == PARTICLE_RADIUS:
            curves.chamfer.append(chamfer(positions, theirs).plain)
        ours_field, their_field = (
            density_field(positions, reference.scene, radius),
            density_field(theirs, reference.scene, PARTICLE_RADIUS),
        )
        curves.density_field.append(float(np.abs(ours_field - their_field).sum() / their_field.sum()))
        curves.height.append(center_height(positions) - center_height(theirs))
        curves.energy.append(kinetic_energy(velocities) - kinetic_energy(reference.velocities[moment * STRIDE]))
        if moment % 5 == 0:
            scale = radius / PARTICLE_RADIUS
            curves.density.append(max_density(kd_tree(positions), scale) / max_density(kd_tree(theirs)))
        if solids.still is not None:
            inside += int((solids.still.distance(torch.from_numpy(positions)) < 0).sum())
    return curves, spent, inside


def floor_curves(file: Path, count: int) -> Curves:
    """The mean curves of the reference's repeats."""
    repeats = []
    with Trajectory(file) as reference:
        for repeat in floor_files(file):
            with Trajectory(repeat) as other:
                moments = ((other.positions[m * STRIDE], other.velocities[m * STRIDE], 0.0) for m in range(count))
                repeats.append(compare(reference, moments, count, PARTICLE_RADIUS, Solids(None))[0])
    return Curves(
        *(list(np.mean([getattr(one, name) for one in repeats], axis=0)) for name in Curves.__dataclass_fields__)
    )


def measure(files: list[Path], floors: list[Curves], setting: tuple[int, int] | None, count: int) -> Row:
    """All measurements of a setting; None for coarse particles."""
    frame_ms, substeps = setting or DEFAULT
    part, radius = FramePart(frame_ms / 1000, substeps), COARSE_RADIUS if setting is None else PARTICLE_RADIUS
    curves, seconds, inside = [], [], 0
    for file in files:
        with Trajectory(file) as reference:
            scene, solids = reference.scene, build_solids(reference.scene)
            start = reference.positions[0], reference.velocities[0]
            frames = coarse_rollout(scene, count) if setting is None else rollout(scene, *start, part, count)
            of_scene, spent, entered = compare(reference, frames, count, radius, solids)
        curves.append(of_scene)
        seconds.append((count - 2) * STRIDE * FRAME_TIME / spent)
        inside += entered
    pool = scene_of(0.6, 0.3, 1)
    first = pool.with_changes(particle_radius=radius).initial_particles(None)
    moments = int(POOL_SECONDS / (STRIDE * FRAME_TIME))
    pool_frames = (
        coarse_rollout(pool, moments)
        if setting is None
        else rollout(pool, first.positions, first.velocities, part, moments)
    )
    *_, (positions, velocities, _) = pool_frames

    def over_floor(at: slice | int) -> float:
        ours = np.array([one.chamfer[at] for one in curves])
        theirs = np.array([one.chamfer[at] for one in floors])
        return round(float(ours.mean() / theirs.mean()), 4)

    fine = setting is not None
    return Row(
        frame_ms, substeps, 1000 * radius, round(float(np.mean(seconds)), 2),
        over_floor(slice(None)) if fine else float("nan"),
        [over_floor(moment // STRIDE) for moment in MOMENTS if moment // STRIDE < count] if fine else [],
        round(1000 * float(np.abs([one.height for one in curves]).max()), 2),
        round(float(np.mean([np.mean(one.energy) for one in curves])), 4),
        round(float(np.max([one.density for one in curves])), 3),
        round(float(np.mean([one.density_field for one in curves])), 4),
        inside,
        round(root_mean_square_speed(velocities), 2), round(1000 * float(positions[:, 2].mean()), 2),
    )  # fmt: skip


def plot(rows: list[Row], path: Path) -> None:
    """Chamfer over the floor against simulated seconds a second: the mean of all frames, and frame 60."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(1, 2, figsize=(10, 4.4), layout="constrained")
    titles = ("mean over all frames", f"frame {MOMENTS[0]}, before chaos")
    for axes, title in zip(panels, titles, strict=True):
        for number, frame_ms in enumerate(sorted({row.frame_ms for row in rows})):
            of_frame = [row for row in rows if row.frame_ms == frame_ms and row.chamfer_at]
            of_frame.sort(key=lambda row: row.substeps)
            x = [row.simulated_seconds for row in of_frame]
            y = [row.chamfer if axes is panels[0] else row.chamfer_at[0] for row in of_frame]
            (line,) = axes.plot(x, y, "o-", label=f"frames of {frame_ms} ms")
            for row, place in zip(of_frame, zip(x, y, strict=True), strict=True):
                shift = (5, 5) if number != 1 else (5, -13)
                axes.annotate(
                    f"{row.substeps or 'fast'}", place, xytext=shift, textcoords="offset points", color=line.get_color()
                )
        axes.axhline(1, color="0.5", linestyle="--", linewidth=1)
        axes.set(xlabel="simulated seconds in a second of one core", title=title)
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("Chamfer distance over the floor")
    panels[0].legend()
    figure.suptitle("Fewer substeps, larger frames; the numbers are substeps of a frame")
    figure.savefig(path, dpi=110)


def main() -> None:
    """Measure all settings, print a line for each, and write the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--frames", type=int, default=800)
    parser.add_argument("--scenes", type=int, default=5)
    parser.add_argument("--plot", type=Path)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    files = trajectory_files(arguments.data)[: arguments.scenes]
    count = arguments.frames // STRIDE
    floors = [floor_curves(file, count) for file in files]
    floor_field = float(np.mean([np.mean(one.density_field) for one in floors]))
    print(f"floor: density field {floor_field:.4f}", flush=True)
    rows = []
    for setting in [*SETTINGS, LONG_STEPS, None]:
        rows.append(measure(files, floors, setting, count))
        print(rows[-1], flush=True)
    default = next(row for row in rows if (row.frame_ms, row.substeps) == DEFAULT)
    near = [row for row in rows if row.chamfer_at and row.chamfer <= 1.1]
    fastest = max(near, key=lambda row: row.simulated_seconds)
    if arguments.plot:
        plot(rows, arguments.plot)
    write_result(
        "frontier",
        claim="Simulated seconds in a second of one core: the fastest setting within 1.10 times the floor",
        figure=fastest.simulated_seconds,
        unit="s",
        peer=f"the default, {DEFAULT[1]} substeps in frames of {DEFAULT[0]} ms",
        peer_figure=default.simulated_seconds,
        command="python benchmarks/frontier.py data/validation --plot docs/images/frontier.png",
        values={"rows": [asdict(row) for row in rows], "floor_density_field": floor_field, "scenes": len(files)},
    )


if __name__ == "__main__":
    main()
