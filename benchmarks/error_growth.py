"""How fast a rollout departs from the reference as the water hits the solid: SPlisHSPlasH itself, and a simulator.

    python benchmarks/error_growth.py [DATA] [--scenes 2] [--simulator NAME] [--every 5] [--no-solver]

Plain Chamfer distance in meters, mean over the first scenes of a data set. SPlisHSPlasH from a start 1 mm aside is the
floor. SPlisHSPlasH restarted every few frames from its own positions and velocities, each particle as a block, shows
what a simulator whose state is positions and velocities could reach. The simulator starts from the scene's start and
from frames of the reference. SPlisHSPlasH takes some minutes a scene, since it restarts 15 times.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import cKDTree

from surfsup.io.trajectory import Trajectory
from surfsup.learned.loading import load_simulator
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import Scene
from surfsup.scene.fluid import InitialParticles
from surfsup.sdf import Surface
from surfsup.sph.environment import Environment
from surfsup.sph.simulator import Simulator
from surfsup.splishsplash import solver

FIRST = 45  # frame of the first restart: in every scene the water still falls, or just touches the solid
MEASURED_FRAMES = (70, 80, 90, 100, 110, 120)
START_FRAMES = (0, 60, 70, 80, 90, 95)  # of the simulator
OFFSET = 1e-3  # meters

Curve = dict[int, float]  # Chamfer distance by frame


def chamfer(positions: np.ndarray, reference: np.ndarray) -> float:
    """Plain Chamfer distance of particles (N, 3), meters."""
    there, back = cKDTree(reference).query(positions)[0], cKDTree(positions).query(reference)[0]
    return float(there.mean() + back.mean())


def offset_runs(scene: Scene, surface: Surface | None, reference: np.ndarray) -> Curve:
    """SPlisHSPlasH with its water moved by 1 mm along x, y and z: the mean of the three."""
    start, curves = scene.initial_particles(surface), []
    for offset in OFFSET * np.eye(3, dtype=np.float32):
        shifted = InitialParticles([block + offset for block in start.block_positions], start.block_velocities, 0)
        run = solver.simulate(scene.with_frames(MEASURED_FRAMES[-1] + 1), surface, shifted)
        frames = [positions for positions, _ in run]
        curves.append([chamfer(frames[frame], reference[frame]) for frame in MEASURED_FRAMES])
    return dict(zip(MEASURED_FRAMES, np.mean(curves, axis=0).tolist(), strict=True))


def restarted_run(
    scene: Scene, surface: Surface | None, reference: np.ndarray, velocities: np.ndarray, every: int
) -> Curve:
    """SPlisHSPlasH restarted every few frames from positions and velocities alone."""
    positions, speeds, curve = reference[FIRST], velocities[FIRST], {}
    for frame in range(FIRST, MEASURED_FRAMES[-1], every):
        blocks = [position[None] for position in positions]
        start = InitialParticles(blocks, [tuple(map(float, velocity)) for velocity in speeds], 0)
        *_, (positions, speeds) = solver.simulate(scene.with_frames(every + 1), surface, start)
        if frame + every in MEASURED_FRAMES:
            curve[frame + every] = chamfer(positions, reference[frame + every])
    return curve


def rollout_errors(
    simulator: Simulator,
    scene: Scene,
    surface: Surface | None,
    reference: np.ndarray,
    velocities: np.ndarray,
    first: int,
    measured: tuple[int, ...] = MEASURED_FRAMES,
) -> Curve:
    """The simulator from the scene's start, or from frame ``first`` of the reference."""
    environment = Environment.of(scene, surface)
    if first == 0:
        start = scene.initial_particles(surface)
        positions = torch.from_numpy(start.positions)
        state = simulator.initial_state(positions, torch.from_numpy(start.velocities), environment)
    else:
        span = slice(first - simulator.history_length, first + 1)
        state = simulator.state_from_frames(torch.from_numpy(reference[span]), torch.from_numpy(velocities[span]))
    curve = {}
    for frame in range(first + 1, measured[-1] + 1):
        state, _ = simulator.step(state, environment)
        if frame in measured:
            curve[frame] = chamfer(state.positions.numpy(), reference[frame])
    return curve


def curves_of(path: Path, simulator: Simulator, every: int, with_solver: bool) -> Iterator[tuple[str, Curve]]:
    """All curves of one scene, by name."""
    with Trajectory(path) as trajectory:
        scene = trajectory.scene
        reference, velocities = trajectory.window(0, MEASURED_FRAMES[-1] + 1)
    surface = scene.build_surface()
    if with_solver:
        yield "SPlisHSPlasH, 1 mm aside", offset_runs(scene, surface, reference)
        restarted = restarted_run(scene, surface, reference, velocities, every)
        yield f"SPlisHSPlasH, restarted every {every}", restarted
    for first in START_FRAMES:
        yield f"from frame {first}", rollout_errors(simulator, scene, surface, reference, velocities, first)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="?", default=Path("data/prim-shapes-validation"))
    parser.add_argument("--scenes", type=int, default=2)
    parser.add_argument("--simulator", default=DEFAULT_SIMULATOR, help="name or weights file")
    parser.add_argument("--every", type=int, default=5, choices=[1, 5], help="frames between restarts")
    parser.add_argument("--solver", action=argparse.BooleanOptionalAction, default=True)
    arguments = parser.parse_args()
    torch.set_grad_enabled(False)
    torch.set_num_threads(1)
    simulator, _ = load_simulator(arguments.simulator)
    curves: dict[str, list[Curve]] = {}
    for path in islice(sorted(arguments.data.glob("*.h5")), arguments.scenes):
        for name, curve in curves_of(path, simulator, arguments.every, arguments.solver):
            curves.setdefault(name, []).append(curve)
    print(f"{'Chamfer, m, at frame':<32}" + "".join(f"{frame:>9}" for frame in MEASURED_FRAMES))
    for name, found in curves.items():
        means = {frame: np.mean([curve[frame] for curve in found]) for frame in found[0]}
        cells = (f"{means[frame]:>9.4f}" if frame in means else f"{'':>9}" for frame in MEASURED_FRAMES)
        print(f"{name:<32}" + "".join(cells))


if __name__ == "__main__":
    main()
