"""Does water stay water where a model has never been: rollouts of scenes of every recipe, without any truth.

    python benchmarks/stability.py [--model NAME] [--seed 99] [--frames 300] [--recipes NAME ...] [-n 6]

For every scene the top speed of any particle, by how much the mechanical energy rises above the start's (water among
things that stand still only loses it), and whether the rollout ended early: blown up, or collapsed into a clump. The
recipes are those that need no files. No scene of the data sets that anything is judged by has this seed.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import torch

from surfsup.datasets.scene_sampling import Drawing
from surfsup.evaluation.rollout import while_sound
from surfsup.learned import weights_file
from surfsup.scene import Scene
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import Environment

RECIPES = ("prim-shapes", "prim-unions", "funnels", "bowls", "chairs", "assorted")


@torch.no_grad()
def course(model: Simulator, scene: Scene, frames: int) -> tuple[int, float, float]:
    """How many frames were sound, the top speed in m/s, and the largest gain of energy in J/kg."""
    surface = scene.build_surface()
    start = scene.start(surface)
    environment = Environment.of(scene, surface)
    state = model.start(torch.from_numpy(start.positions), torch.from_numpy(start.particle_velocities), environment)
    energies, speeds = [], []
    for now, _ in while_sound(model.rollout(state, environment, frames)):
        squared = now.velocities.square().sum(dim=-1)
        energies.append(float(squared.mean() / 2 - (now.positions @ environment.gravity).mean()))
        speeds.append(float(squared.max().sqrt()))
    return len(energies), max(speeds), max(energies) - energies[0]


def main() -> None:
    """One line a recipe: of each of its scenes speed and gain, and how many frames where it ended early."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default=weights_file.DEFAULT_MODEL)
    parser.add_argument("--seed", type=int, default=99)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--recipes", nargs="+", default=RECIPES)
    parser.add_argument("-n", type=int, default=6, help="scenes of each recipe")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    model, _ = weights_file.load(weights_file.find(arguments.model))
    print("top speed in m/s / gain in J/kg of each scene (frames that were sound, where not all)")
    for recipe in arguments.recipes:
        with tempfile.TemporaryDirectory() as folder:
            drawing = Drawing(recipe, arguments.seed, None, Path(folder))
            told, began, frames = [], time.process_time(), 0
            for index in range(arguments.n):
                sound, speed, gain = course(model, drawing.scene(index), arguments.frames)
                told.append(f"{speed:.1f}/{gain:.3f}" + (f" ({sound})" if sound < arguments.frames else ""))
                frames += sound
        print(
            f"{recipe}: {', '.join(told)}; {1000 * (time.process_time() - began) / frames:.1f} ms a frame", flush=True
        )


if __name__ == "__main__":
    main()
