"""Stability on unseen scenes: rollouts of scenes of every recipe, without a reference.

    python benchmarks/stability.py [--simulator NAME] [--seed 99] [--frames 300] [--recipes NAME ...] [-n 6]

For every scene the program prints the top speed of any particle, the largest gain of mechanical energy over the start
(water among resting solids only loses energy), and the number of valid frames if the rollout diverged or collapsed.
The recipes are those that need no files. No scene of the training, validation and test sets has this seed.

The result is written to `benchmarks/results/stability.json`.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import torch

from record import write_result
from surfsup.datasets.generation.scene_sampler import SceneSampler
from surfsup.evaluation.rollout import until_diverged
from surfsup.learned.loading import load_simulator
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import Scene
from surfsup.sph.environment import Environment
from surfsup.sph.simulator import Simulator

RECIPES = ("prim-shapes", "prim-unions", "funnels", "bowls", "chairs", "assorted")


@torch.no_grad()
def stability_of(simulator: Simulator, scene: Scene, frames: int) -> tuple[int, float, float]:
    """The number of valid frames, the top speed in m/s, and the largest gain of mechanical energy in J/kg."""
    surface = scene.build_surface()
    start = scene.initial_particles(surface)
    environment = Environment.of(scene, surface)
    positions, velocities = torch.from_numpy(start.positions), torch.from_numpy(start.velocities)
    state = simulator.initial_state(positions, velocities, environment)
    energies, speeds = [], []
    for current, _ in until_diverged(simulator.rollout(state, environment, frames)):
        squared = current.velocities.square().sum(dim=-1)
        energies.append(float(squared.mean() / 2 - (current.positions @ environment.gravity).mean()))
        speeds.append(float(squared.max().sqrt()))
    return len(energies), max(speeds), max(energies) - energies[0]


def main() -> None:
    """Print a line for each recipe, write the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--simulator", default=DEFAULT_SIMULATOR, help="name or weights file")
    parser.add_argument("--seed", type=int, default=99)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--recipes", nargs="+", default=RECIPES)
    parser.add_argument("-n", type=int, default=6, help="scenes of each recipe")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    simulator, _ = load_simulator(arguments.simulator)
    scenes: dict[str, list[dict[str, float]]] = {}
    print("top speed in m/s / energy gain in J/kg of each scene (valid frames, if not all)")
    for recipe in arguments.recipes:
        with tempfile.TemporaryDirectory() as folder:
            sampler = SceneSampler(recipe, arguments.seed, None, Path(folder))
            began = time.process_time()
            measured = [stability_of(simulator, sampler.scene(index), arguments.frames) for index in range(arguments.n)]
            seconds = time.process_time() - began
        scenes[recipe] = [{"frames": valid, "speed": speed, "gain": gain} for valid, speed, gain in measured]
        cells = [
            f"{speed:.1f}/{gain:.3f}" + (f" ({valid})" if valid < arguments.frames else "")
            for valid, speed, gain in measured
        ]
        milliseconds = 1000 * seconds / sum(valid for valid, _, _ in measured)
        print(f"{recipe}: {', '.join(cells)}; {milliseconds:.1f} ms a frame", flush=True)
    everything = [scene for found in scenes.values() for scene in found]
    diverged = sum(scene["frames"] < arguments.frames for scene in everything)
    if arguments.simulator == DEFAULT_SIMULATOR:
        write_result(
            "stability",
            f"Largest gain of mechanical energy in {len(everything)} scenes of {arguments.frames} frames "
            f"(diverged: {diverged})",
            round(max(scene["gain"] for scene in everything), 6),
            "J/kg",
            None,
            None,
            " ".join(["python benchmarks/stability.py", *sys.argv[1:]]),
            values={"diverged": diverged, "top_speed_m_s": max(scene["speed"] for scene in everything), **scenes},
            threads=1,
        )


if __name__ == "__main__":
    main()
