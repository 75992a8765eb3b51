"""Score weights on validation scenes: rollouts with and without collision handling, ten frames, the fall of a block.

    python score_rollouts.py NAME WEIGHTS_OR_RUN [--scenes 3] [--frames 300] [--data data/validation]
        [--collisions off,on] [--no-falls]

Appends a line of JSON to scores.jsonl. Where the data set has a floor (``surfsup floor data/validation``), it also
gives Chamfer divided by the floor of the same scenes and frames. Never use it on a test set.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch

from surfsup.evaluation.floor import floor_files
from surfsup.evaluation.load_trajectories import trajectory_files
from surfsup.evaluation.metrics import center_height, chamfer, kd_tree, kinetic_energy, max_density
from surfsup.evaluation.rollout import roll_out, until_diverged
from surfsup.io.trajectory import Trajectory
from surfsup.learned import weights_file
from surfsup.learned.base import LearnedSimulator
from surfsup.scene import Scene
from surfsup.sph.environment import Environment
from surfsup.training.run import load_average

BLOCK = "fluid: [{block: {min: [-0.22, -0.22, 1.2], max: [0.22, 0.22, 1.62]}}]"
BALL = "surface: {sphere: {radius: 0.35}, at: [0, 0, 0.35]}"
ROOMS = {
    "usual": f"{{{BALL}, {BLOCK}}}",
    "2x2x2": f"{{container: {{size: [2, 2, 2]}}, {BALL}, {BLOCK}}}",
    "2x2x2, ball aside": f"{{container: {{size: [2, 2, 2]}}, {BALL.replace('0, 0, 0.35', '0.6, 0.6, 0.35')}, "
    "fluid: [{block: {min: [-0.7, -0.7, 1.2], max: [-0.26, -0.26, 1.62]}}]}",
    "2x2x2, empty": f"{{container: {{size: [2, 2, 2]}}, {BLOCK}}}",
}
FALL_FRAMES = 40
FIRST_FRAMES = (10, 60, 75, 90, 110, 150, 200)
CHAMFER_STRIDE, DENSITY_STRIDE = 5, 20  # frames


@torch.no_grad()
def falls(simulator: LearnedSimulator) -> dict[str, list[float]]:
    """By room: share by which the block has fallen too little, and its spread about the free fall in meters."""
    results = {}
    steps = 5 * FALL_FRAMES
    exact = np.array([0, 0, -9.81e-6 * steps * (steps + 1) / 2])
    for room, text in ROOMS.items():
        scene = Scene.from_yaml(text, room)
        surface = scene.build_surface()
        environment, start = Environment.of(scene, surface), scene.initial_particles(surface)
        state = simulator.initial_state(
            torch.from_numpy(start.positions), torch.from_numpy(start.velocities), environment
        )
        frames = list(until_diverged(simulator.rollout(state, environment, FALL_FRAMES + 1, False)))
        moved = frames[-1][0].positions.numpy() - start.positions
        spread = np.sqrt(np.square(moved - exact).sum(axis=1).mean())
        results[room] = [round(float(1 - moved[:, 2].mean() / exact[2]), 4), round(float(spread), 4)]
    return results


@torch.no_grad()
def ten_frames(simulator: LearnedSimulator, files: list[Path]) -> dict[int, float]:
    """Mean distance from the reference, mm, ten frames after a true state, without collision handling; by first frame.

    In so few frames chaos has no part yet.
    """
    results = {}
    for first in FIRST_FRAMES:
        errors = []
        for file in files:
            with Trajectory(file) as reference:
                environment = Environment.of(reference.scene, reference.scene.build_surface())
                frames = slice(first - simulator.history_length, first + 11)
                positions, velocities = (
                    torch.from_numpy(data[frames]) for data in (reference.positions, reference.velocities)
                )
            history = simulator.history_length + 1
            state = simulator.state_from_frames(positions[:history], velocities[:history])
            for _ in range(10):
                state, _ = simulator.step(state, environment, handle_collisions=False)
            errors.append(float((state.positions - positions[-1]).norm(dim=-1).mean()))
        results[first] = round(1000 * float(np.mean(errors)), 3)
    return results


def floor_of(path: Path, frames: int) -> float:
    """Mean Chamfer distance of the floor's runs of a trajectory; NaN without a floor."""
    values = []
    with Trajectory(path) as reference:
        for file in floor_files(path):
            with Trajectory(file) as repeat:
                numbers = range(0, frames, CHAMFER_STRIDE)
                values += [chamfer(repeat.positions[n], reference.positions[n]).plain for n in numbers]
    return float(np.mean(values)) if values else float("nan")


@torch.no_grad()
def score(simulator: LearnedSimulator, path: Path, frames: int, handle_collisions: bool) -> dict[str, float]:
    """The scores of one rollout."""
    distances, heights, energies, true_energies, densities = {}, [], [], [], []
    inside = outside = lost = last = 0
    with Trajectory(path) as reference:
        environment = Environment.of(reference.scene, reference.scene.build_surface())
        frames = min(frames, len(reference))
        true_positions, true_velocities = reference.positions[:frames], reference.velocities[:frames]
        for last, (state, _) in enumerate(roll_out(simulator, reference, environment, frames, handle_collisions)):
            positions, truth = state.positions.numpy(), true_positions[last]
            if last % CHAMFER_STRIDE == 0:
                distances[last] = chamfer(positions, truth).plain
            if last % DENSITY_STRIDE == 0:
                densities.append(max_density(kd_tree(positions)))
            heights.append(abs(center_height(positions) - center_height(truth)))
            energies.append(kinetic_energy(state.velocities.numpy()))
            true_energies.append(kinetic_energy(true_velocities[last]))
            if environment.surface is not None:
                inside += int((environment.surface.distance(state.positions) < 0).sum())
            out = ((state.positions < environment.lower) | (state.positions > environment.upper)).any(dim=-1)
            lost = int(out.sum())
            outside += lost
    complete = last == frames - 1
    return {
        "chamfer": float(np.mean(list(distances.values()))) if complete else float("nan"),
        "floor": floor_of(path, frames),
        "at100": distances.get(100, float("nan")),
        "height": float(np.mean(heights)),
        "energy": sum(energies) / sum(true_energies),
        "inside": inside,
        "outside": outside,
        "lost": lost,
        "density": max(densities),
        "frames": last + 1,
    }


def main() -> None:
    """Score the weights named on the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("weights")
    parser.add_argument("--scenes", type=int, default=3)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--data", type=Path, default=Path("data/validation"))
    parser.add_argument("--collisions", default="off,on")
    parser.add_argument("--no-falls", action="store_true")
    options = parser.parse_args()
    torch.set_num_threads(1)
    start, path = time.monotonic(), Path(options.weights)
    simulator = load_average(path).eval() if path.is_dir() else weights_file.load(weights_file.find(options.weights))[0]
    row = {"name": options.name, "scenes": options.scenes, "frames": options.frames}
    if not options.no_falls:
        row["falls"] = falls(simulator)
        print(row["falls"], flush=True)
    files = trajectory_files(options.data, options.scenes)
    row["ten"] = ten_frames(simulator, files)
    print("ten frames, mm:", row["ten"], round(float(np.mean(list(row["ten"].values()))), 3), flush=True)
    for collisions in filter(None, options.collisions.split(",")):
        each = []
        for file in files:
            each.append(score(simulator, file, options.frames, collisions == "on"))
            print(f"{collisions}, {file.stem}:", {k: round(v, 4) for k, v in each[-1].items()}, flush=True)
        mean = {key: float(np.mean([one[key] for one in each])) for key in each[0]}
        mean["ratio"] = mean["chamfer"] / mean["floor"]
        row[collisions], row[f"{collisions}_each"] = mean, each
        print(f"{collisions}, mean:", {k: round(v, 4) for k, v in mean.items()}, flush=True)
    row["seconds"] = round(time.monotonic() - start)
    with open("scores.jsonl", "a") as file:
        file.write(json.dumps(row) + "\n")


main()
