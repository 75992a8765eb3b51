"""Memory of a training step: the additional peak memory of a process that trains.

    python benchmarks/training_memory.py [--size paper] [--particles 3000] [--precision bf16 32] [--steps 8]

Each step of `surfsup train` takes one window of falling water, with optimizer and averaged weights. The memory before
is that of the libraries and the network. The number of particles changes from step to step, as in training, so that
caches count too. The goal is 2 GB for `paper` in bf16.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import torch
from numpy.random import default_rng

from surfsup.datasets.windows import Window
from surfsup.scene import Scene
from surfsup.sph.environment import Environment
from surfsup.training.config import load_config
from surfsup.training.objectives import Batch
from surfsup.training.run import TrainingRun

SPACING = 0.033  # of a jittered lattice that has nine neighbors within 0.045
SCENE = (
    "surface: {sphere: {radius: 0.3}, at: [0, 0, 0.3]}\nfluid: [{block: {min: [-0.2, -0.2, 1], max: [0.2, 0.2, 1.4]}}]"
)


def main() -> None:
    """Measure every precision in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="paper")
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("--precision", nargs="+", default=["bf16", "32"])
    parser.add_argument("--steps", type=int, default=8)
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        print(json.dumps(measure(arguments.size, arguments.precision[0], arguments.particles, arguments.steps)))
        return
    print(f"{arguments.size}, {arguments.particles} particles, batch 1, {arguments.steps} steps; MB")
    print(f"{'':<6}{'before':>8}{'a step takes':>14}{'after all':>11}")
    for precision in arguments.precision:
        sizes = [f"--{name}={getattr(arguments, name)}" for name in ("size", "particles", "steps")]
        command = [sys.executable, __file__, "--child", "--precision", precision, *sizes]
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        before, first, last = json.loads(done.stdout)
        print(f"{precision:<6}{before:>8.0f}{first - before:>14.0f}{last - before:>11.0f}", flush=True)


def measure(size: str, precision: str, particles: int, steps: int) -> tuple[float, float, float]:
    """Peak memory, MB: before the first step, after it, after all steps."""
    torch.set_num_threads(1)
    config = load_config("surfsup", [f"size={size}", f"precision={precision}", "batch=1"])
    with tempfile.TemporaryDirectory() as folder:
        run = TrainingRun(config, Path(folder))
        marks = [peak_memory()]
        for step in range(steps):
            count = particles - 37 * step % (particles // 3)
            run.take_step(Batch([water(count, run.model.history_length)], [default_rng(step)]))
            marks.append(peak_memory())
    return marks[0], marks[1], marks[-1]


def water(particles: int, past: int) -> Window:
    """A window of disordered water that falls beside a ball."""
    random = torch.Generator().manual_seed(particles)
    side = round(particles ** (1 / 3) + 0.5)
    places = torch.cartesian_prod(*[torch.arange(side) * SPACING] * 3)[:particles]
    places = places + 0.2 * SPACING * torch.randn(places.shape, generator=random)
    fall = torch.linspace(0, -0.05, past + 2)[:, None, None] * torch.tensor([0.0, 0.0, 1.0])
    scene = Scene.from_yaml(SCENE, "water beside a ball")
    positions = places + fall
    environment = Environment.of(scene, scene.build_surface())
    return Window(positions, torch.zeros_like(positions), past, environment, scene, "water")


def peak_memory() -> float:
    """Peak memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
