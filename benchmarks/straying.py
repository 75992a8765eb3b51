"""How fast a rollout strays from the truth as the water strikes: the solver's own, and the model's from true states.

    python benchmarks/straying.py [DATA] [--scenes 2] [--model NAME] [--every 5] [--no-solver]

Plain Chamfer, meters, mean over the first scenes of a data set. The solver started 1 mm aside is the floor. The solver
started anew every few frames from its own positions and velocities, each particle a block of its own, tells what a
model that knows no more than these could reach. The model is started at the scene's start and at true frames. The
solver's part takes some minutes a scene, for it starts anew 15 times.
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
from surfsup.learned import weights_file
from surfsup.scene import Scene
from surfsup.scene.fluid import Start
from surfsup.sdf import Surface
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import Environment
from surfsup.splishsplash import solver

FIRST = 45  # the frame from which the solver is started anew: all scenes are still falling, or just touch
ASKED = (70, 80, 90, 100, 110, 120)
STARTS = (0, 60, 70, 80, 90, 95)  # the model's
ASIDE = 1e-3  # meters

Told = dict[int, float]  # Chamfer by frame


def chamfer(water: np.ndarray, truth: np.ndarray) -> float:
    """Plain, of particles (N, 3), meters."""
    there, back = cKDTree(truth).query(water)[0], cKDTree(water).query(truth)[0]
    return float(there.mean() + back.mean())


def aside(scene: Scene, surface: Surface | None, truth: np.ndarray) -> Told:
    """The solver with its water moved along x, y and z, the mean of the three."""
    start, told = scene.start(surface), []
    for move in ASIDE * np.eye(3, dtype=np.float32):
        moved = Start([block + move for block in start.blocks], start.velocities, 0)
        frames = [water for water, _ in solver.simulate(scene.with_frames(ASKED[-1] + 1), surface, moved)]
        told.append([chamfer(frames[frame], truth[frame]) for frame in ASKED])
    return dict(zip(ASKED, np.mean(told, axis=0).tolist(), strict=True))


def anew(scene: Scene, surface: Surface | None, truth: np.ndarray, velocities: np.ndarray, every: int) -> Told:
    """The solver that forgets all but positions and velocities every few frames."""
    water, speed, told = truth[FIRST], velocities[FIRST], {}
    for frame in range(FIRST, ASKED[-1], every):
        start = Start([place[None] for place in water], [tuple(map(float, one)) for one in speed], 0)
        *_, (water, speed) = solver.simulate(scene.with_frames(every + 1), surface, start)
        if frame + every in ASKED:
            told[frame + every] = chamfer(water, truth[frame + every])
    return told


def rolled_out(
    model: Simulator,
    scene: Scene,
    surface: Surface | None,
    truth: np.ndarray,
    velocities: np.ndarray,
    first: int,
    asked: tuple[int, ...] = ASKED,
) -> Told:
    """The model from the scene's start, or from the true frame ``first``, in the frames ``asked`` for."""
    environment = Environment.of(scene, surface)
    if first == 0:
        start = scene.start(surface)
        state = model.start(torch.from_numpy(start.positions), torch.from_numpy(start.particle_velocities), environment)
    else:
        span = slice(first - model.past, first + 1)
        state = model.state_after(torch.from_numpy(truth[span]), torch.from_numpy(velocities[span]))
    told = {}
    for frame in range(first + 1, asked[-1] + 1):
        state, _ = model.step(state, environment)
        if frame in asked:
            told[frame] = chamfer(state.positions.numpy(), truth[frame])
    return told


def rows(path: Path, model: Simulator, every: int, with_solver: bool) -> Iterator[tuple[str, Told]]:
    """What is told of one scene."""
    with Trajectory(path) as trajectory:
        scene = trajectory.scene
        truth, velocities = trajectory.window(0, ASKED[-1] + 1)
    surface = scene.build_surface()
    if with_solver:
        yield "solver, 1 mm aside", aside(scene, surface, truth)
        yield f"solver, anew every {every}", anew(scene, surface, truth, velocities, every)
    for first in STARTS:
        yield f"model from frame {first}", rolled_out(model, scene, surface, truth, velocities, first)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="?", default=Path("data/prim-shapes-validation"))
    parser.add_argument("--scenes", type=int, default=2)
    parser.add_argument("--model", default=weights_file.DEFAULT_MODEL)
    parser.add_argument("--every", type=int, default=5, choices=[1, 5], help="frames; the asked ones must be hit")
    parser.add_argument("--solver", action=argparse.BooleanOptionalAction, default=True)
    arguments = parser.parse_args()
    torch.set_grad_enabled(False)
    torch.set_num_threads(1)
    model, _ = weights_file.load(weights_file.find(arguments.model))
    told: dict[str, list[Told]] = {}
    for path in islice(sorted(arguments.data.glob("*.h5")), arguments.scenes):
        for name, found in rows(path, model, arguments.every, arguments.solver):
            told.setdefault(name, []).append(found)
    print(f"{'Chamfer, m, at frame':<24}" + "".join(f"{frame:>9}" for frame in ASKED))
    for name, found in told.items():
        means = {frame: np.mean([one[frame] for one in found]) for frame in found[0]}
        print(f"{name:<24}" + "".join(f"{means[frame]:>9.4f}" if frame in means else f"{'':>9}" for frame in ASKED))


if __name__ == "__main__":
    main()
