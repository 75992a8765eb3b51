"""Time of a frame by each engine of the solver: C++, Warp, and Warp with gradients; and the memory of a long gradient.

    python benchmarks/engines.py [--particles 3000 50000] [--rounds 7] [--frames 75]

A block of water falls on a ball (the scene of against_solver.py). From the frame of the impact each engine advances the
same state by one frame, `--rounds` times; the fastest round counts, since a shared host disturbs the times.
With gradients the frame is followed by the gradient of its end in positions, velocities and the ball's radius. All of
it runs on one thread of the CPU. Every time is wall clock, and in brackets processor time. Before, the memory that the
gradient of a rollout over `--frames` frames of the smallest scene takes beyond that of a single frame.

The results are written to `benchmarks/results/engines_*.json`.
"""

from __future__ import annotations

import argparse
import os
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import torch

from against_solver import RADIUS, Timing, mean_timing, scene_of
from record import write_result
from surfsup.design.rollout import last_frame
from surfsup.sdf import Sphere, Transformed
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState

IMPACT = 40  # frames from the start
PAUSE = 0.005  # seconds between two samples of the memory
MEGABYTE = 2**20


def warp_solver() -> DfsphSolver:
    """The solver as on a machine without a compiler."""
    solver = DfsphSolver()
    solver.native = None
    return solver


def impact(particles: int) -> tuple[ParticleState, Environment]:
    """The particles at the impact, and the scene's environment."""
    scene = scene_of(particles, IMPACT + 1)
    surface = scene.build_surface()
    start = scene.initial_particles(surface)
    environment = Environment.of(scene, surface)
    state = ParticleState(torch.from_numpy(start.positions), torch.from_numpy(start.velocities))
    *_, (state, _) = DfsphSolver().rollout(state, environment, IMPACT + 1)
    return state, environment


def with_radius(environment: Environment, radius: torch.Tensor) -> Environment:
    """The environment with a ball whose radius carries a gradient, hence without a boundary map."""
    ball = Transformed(Sphere(radius), None, (0.0, 0.0, RADIUS))
    return Environment(ball, environment.lower, environment.upper, environment.gravity)


def frame_without_gradient(solver: DfsphSolver, state: ParticleState, environment: Environment) -> None:
    """A frame."""
    with torch.no_grad():
        solver.step(state, environment)


def frame_with_gradient(solver: DfsphSolver, state: ParticleState, environment: Environment) -> None:
    """A frame, and the gradient of its end."""
    radius = torch.tensor(RADIUS, requires_grad=True)
    positions, velocities = (value.detach().requires_grad_() for value in (state.positions, state.velocities))
    after, _ = solver.step(ParticleState(positions, velocities), with_radius(environment, radius))
    total = after.positions.square().sum() + after.velocities.square().sum()
    torch.autograd.grad(total, [positions, velocities, radius])


def fastest(frames: dict[str, Callable[[], Any]], rounds: int) -> dict[str, Timing]:
    """The fastest of ``rounds`` calls of each function, after one that is not counted."""
    for frame in frames.values():
        frame()
    timings = [{name: mean_timing(frame, 1) for name, frame in frames.items()} for _ in range(rounds)]
    return {name: (min(t[name][0] for t in timings), min(t[name][1] for t in timings)) for name in frames}


def resident() -> float:
    """Memory of this process now, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / MEGABYTE


def peak_beyond_now(work: Callable[[], Any]) -> float:
    """The most memory in MB that ``work`` takes beyond what the process has already."""
    before, done = resident(), threading.Event()
    peak = before

    def watch() -> None:
        nonlocal peak
        while not done.is_set():
            peak = max(peak, resident())
            time.sleep(PAUSE)

    watcher = threading.Thread(target=watch)
    watcher.start()
    work()
    done.set()
    watcher.join()
    return peak - before


def gradient_of_rollout(state: ParticleState, environment: Environment, frames: int) -> None:
    """The gradient of a rollout's last frame in the ball's radius."""
    radius = torch.tensor(RADIUS, requires_grad=True)
    end = last_frame(DfsphSolver(), with_radius(environment, radius), state, frames)
    torch.autograd.grad(end.positions.square().sum(), radius)


def main() -> None:
    """Print the times and the memory, write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, nargs="+", default=[3000, 50000])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--frames", type=int, default=75, help="of the rollout whose memory is measured")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    state, environment = impact(min(arguments.particles))
    gradient_of_rollout(state, environment, 1)
    memory = peak_beyond_now(lambda: gradient_of_rollout(state, environment, arguments.frames))
    count = len(state.positions)
    print(f"gradient of {arguments.frames} frames of {count} particles: {memory:.0f} MB more than that of one frame")
    write_result(
        "engines_memory",
        f"Memory of the gradient of {arguments.frames} frames of {count:,} particles beyond that of one frame",
        round(memory),
        "MB",
        None,
        None,
        f"python benchmarks/engines.py --frames {arguments.frames}",
        threads=1,
    )
    for particles in arguments.particles:
        state, environment = impact(particles)
        count = len(state.positions)
        cpp, warp = DfsphSolver(), warp_solver()

        engines = {
            "Warp": partial(frame_without_gradient, warp, state, environment),
            "Warp with gradients": partial(frame_with_gradient, warp, state, environment),
        }
        if cpp.native is not None:
            engines = {"C++": partial(frame_without_gradient, cpp, state, environment), **engines}
        timings = fastest(engines, arguments.rounds)
        print(
            f"{count} particles; ms wall (processor): "
            + ", ".join(f"{name} {wall:.1f} ({processor:.1f})" for name, (wall, processor) in timings.items()),
            flush=True,
        )
        command = f"python benchmarks/engines.py --particles {particles}"
        peer = "C++ without gradients" if "C++" in timings else None
        write_result(
            f"engines_{particles}",
            f"Time of a frame of 5 ms with gradients, {count:,} particles falling on a ball, one thread",
            round(timings["Warp with gradients"][0], 1),
            "ms",
            peer,
            round(timings["C++"][0], 1) if peer else None,
            command,
            values={
                "particles": count,
                "ms_wall": {name: round(wall, 2) for name, (wall, _) in timings.items()},
                "ms_processor": {name: round(processor, 2) for name, (_, processor) in timings.items()},
            },
            threads=1,
        )


if __name__ == "__main__":
    main()
