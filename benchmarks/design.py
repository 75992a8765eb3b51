"""Cost of inverse design: time of 100 iterations of the bowl, and memory of a gradient over 75 frames.

    python benchmarks/design.py [--iterations 100] [--particles 3000] [--frames 75] [--threads 2]

Time: a whole run of `surfsup design bowl` that does not end early, by the clock and as processor time, which is
comparable on a busy machine. The goal is 90 seconds for 100 iterations. Memory: the additional peak memory of a process
that computes one gradient of the mean height of `--particles` particles over a bowl; the goal is 3 GB. The program also
measures four times as many frames, and fewer frames with all of them kept.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from unittest import mock

import torch

from record import write_result
from surfsup.design import DesignRun, bowl
from surfsup.design.history import process_cpu_seconds
from surfsup.design.rollout import last_frame
from surfsup.scene import Scene
from surfsup.sdf import Bowl, Transformed
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState

ALL_KEPT = 10  # frames, since memory grows with each when all are kept


def main() -> None:
    """Measure time here, memory in children."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--iterations", type=int, default=100)
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("--frames", type=int, default=75)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--child", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    if arguments.child:
        print(json.dumps(memory(arguments.particles, arguments.frames, arguments.child == "all")))
        return
    clock, processor, run = bowl_seconds(arguments.iterations)
    particles = len(run.task.initial_state().positions)
    print(
        f"bowl, {particles} particles, 50 frames, {arguments.threads} threads, {arguments.iterations} iterations:",
        end=" ",
    )
    print(f"{clock:.0f} s, {processor:.0f} processor seconds, reward {run.rewards[0]:.4f} to {max(run.rewards):.4f}")
    write_result(
        "design_bowl",
        f"{arguments.iterations} iterations of the bowl's design as one run: {particles} particles, 50 frames",
        round(processor, 1),
        "processor seconds",
        None,
        None,
        f"python benchmarks/design.py --threads {arguments.threads}",
        {
            "clock_s": round(clock, 1),
            "load": round(os.getloadavg()[0], 1),
            "first_reward": run.rewards[0],
            "best_reward": max(run.rewards),
        },
        threads=arguments.threads,
    )
    for frames, kept in ((arguments.frames, "segments"), (4 * arguments.frames, "segments"), (ALL_KEPT, "all")):
        sizes = [f"--particles={arguments.particles}", f"--frames={frames}", f"--threads={arguments.threads}"]
        done = subprocess.run([sys.executable, __file__, f"--child={kept}", *sizes], check=True, stdout=subprocess.PIPE)
        before, after = json.loads(done.stdout)
        mode = "all frames kept" if kept == "all" else "checkpointed"
        print(f"{arguments.particles} particles, {frames} frames, {mode}: {after - before:.0f} MB", flush=True)


def bowl_seconds(iterations: int) -> tuple[float, float, DesignRun]:
    """Seconds of the clock and of the processor that a run of the bowl takes, and the run."""
    with tempfile.TemporaryDirectory() as folder:
        began, worked = time.monotonic(), process_cpu_seconds()
        run = DesignRun(bowl(), Path(folder), iterations)
        for _ in range(iterations):
            run.iterate()
        return time.monotonic() - began, process_cpu_seconds() - worked, run


def memory(particles: int, frames: int, keep_all: bool) -> tuple[float, float]:
    """Peak memory, MB: before the gradient and after it."""
    capture = torch.tensor(0.25, requires_grad=True)
    scene = Scene.from_yaml("fluid: [{block: {min: [-0.25, -0.25, 0.52], max: [0.25, 0.25, 1.0]}}]", "water")
    environment = Environment.of(scene, Transformed(Bowl(capture), translation=(0.0, 0.0, 0.5)))
    side = round(particles ** (1 / 3) + 0.5)
    places = torch.cartesian_prod(*[torch.arange(side) * 0.03] * 3)[:particles]
    places = places - torch.tensor([0.015 * (side - 1), 0.015 * (side - 1), -0.53])
    start = ParticleState(places, torch.tensor([0.0, 0.0, -2.0]).expand_as(places))
    before = peak_memory()
    length = frames if keep_all else None
    with mock.patch("surfsup.design.rollout.math.isqrt", lambda n: length) if length else mock.MagicMock():
        end = last_frame(DfsphSolver(), environment, start, frames)
        end.positions[:, 2].mean().backward()
    return before, peak_memory()


def peak_memory() -> float:
    """Peak memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
