"""Time of a training step and of a frame of the paper's networks: in C++ against the same networks in torch.

    python benchmarks/graph_networks.py [--kinds surfsup gns] [--sizes small paper] [--particles 2700] [--threads 1]

A block of water falls on a ball (the scene of against_solver.py); the particles are those at the impact, those of the
surface come to them for `gns`. A training step is that of training on one window without push-forward: state with
noise, neighbors, features, network in bfloat16, loss, gradient, update by SOAP. A frame is one step of a rollout with
collision handling, without gradients, in single precision. Both implementations take turns, `--rounds` times; the
fastest round counts, since a shared host disturbs the times. Every time is wall clock, and in brackets processor time.

The results are written to `benchmarks/results/graph_networks_*.json`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from typing import Any
from unittest import mock

import numpy as np
import torch

from against_solver import Timing, mean_timing, scene_of
from record import write_result
from surfsup.datasets.windows import Window
from surfsup.learned.message_passing import network
from surfsup.learned.message_passing.architecture import SIZES
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.registry import LEARNED_SIMULATORS
from surfsup.optim.soap import Soap
from surfsup.sph.environment import Environment
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState
from surfsup.training.config import Phase
from surfsup.training.objectives.acceleration import AccelerationObjective
from surfsup.training.objectives.objective import Batch

IMPACT = 40  # frames from the start
KINDS = ("surfsup", "value-only", "no-sdf", "gns")
PHASE = Phase(until=1.0, noise=3e-4)
IMPLEMENTATIONS: dict[str, Callable[[], Any]] = {
    "C++": nullcontext,
    "torch": partial(mock.patch.object, network, "native_precision", return_value=None),
}


def impact(particles: int) -> Window:
    """The frames up to the impact and the one after it."""
    scene = scene_of(particles, IMPACT + 2)
    surface = scene.build_surface()
    start = scene.initial_particles(surface)
    environment = Environment.of(scene, surface)
    state = ParticleState(torch.from_numpy(start.positions), torch.from_numpy(start.velocities))
    frames = [state for state, _ in DfsphSolver().rollout(state, environment, IMPACT + 2)]
    length = MessagePassingSimulator.history_length
    last = frames[-length - 2 :]
    positions, velocities = (
        torch.stack([getattr(frame, name) for frame in last]) for name in ("positions", "velocities")
    )
    return Window(positions, velocities, length, environment, scene, "impact")


def train_once(objective: AccelerationObjective, optimizer: Soap, window: Window) -> None:
    """A training step."""
    optimizer.zero_grad()
    loss, _ = objective(Batch([window], [np.random.default_rng(0)]), PHASE)
    loss.backward()
    optimizer.step()


def predict_once(model: MessagePassingSimulator, window: Window) -> None:
    """A frame of a rollout."""
    with torch.no_grad():
        model.step(model.state_from_frames(*window.history), window.environment)


def fastest(work: Callable[[], None], rounds: int) -> dict[str, Timing]:
    """The fastest of ``rounds`` calls with each implementation, after one that is not counted."""
    timings: dict[str, list[Timing]] = {name: [] for name in IMPLEMENTATIONS}
    for _ in range(rounds + 1):
        for name, implementation in IMPLEMENTATIONS.items():
            with implementation():
                timings[name].append(mean_timing(work, 1))
    return {name: (min(wall for wall, _ in ts[1:]), min(cpu for _, cpu in ts[1:])) for name, ts in timings.items()}


def report(job: str, kind: str, size: str, timings: dict[str, Timing], values: dict[str, Any], threads: int) -> None:
    """Print one line and write one result."""
    layers, width = SIZES[size]["layers"], SIZES[size]["width"]
    line = ", ".join(f"{name} {wall:.1f} ({processor:.1f})" for name, (wall, processor) in timings.items())
    print(f"{job}, {kind} {layers}x{width}: {line} ms", flush=True)
    write_result(
        f"graph_networks_{job.replace(' ', '_')}_{kind}_{size}",
        f"Processor time of a {job} of `{kind}` at {layers}×{width}, {values['particles']:,} particles, threads: {threads}",
        round(timings["C++"][1], 1),
        "ms",
        "the same network in torch",
        round(timings["torch"][1], 1),
        f"python benchmarks/graph_networks.py --kinds {kind} --sizes {size} --threads {threads}",
        values=values
        | {
            "ms_wall": {name: round(wall, 1) for name, (wall, _) in timings.items()},
            "ms_processor": {name: round(processor, 1) for name, (_, processor) in timings.items()},
        },
        threads=threads,
    )


def main() -> None:
    """Print the times and write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--sizes", nargs="+", choices=list(SIZES), default=["small", "paper"])
    parser.add_argument("--particles", type=int, default=2700)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    window = impact(arguments.particles)
    for size in arguments.sizes:
        for kind in arguments.kinds:
            torch.manual_seed(0)
            simulator = LEARNED_SIMULATORS[kind]
            model = simulator(simulator.architecture_type(**SIZES[size]))
            assert isinstance(model, MessagePassingSimulator)
            state = model.nodes(model.state_from_frames(*window.history), window.environment)
            edges = len(find_neighbors(state.positions, model.architecture.radius).senders)
            values = {"particles": window.positions.shape[1], "nodes": len(state.positions), "edges": edges}
            optimizer = Soap(model.parameters(), lr=1e-4)
            step = partial(train_once, AccelerationObjective(model, bf16=True), optimizer, window)
            report("training step", kind, size, fastest(step, arguments.rounds), values, arguments.threads)
            frame = partial(predict_once, model, window)
            report("frame", kind, size, fastest(frame, arguments.rounds), values, arguments.threads)


if __name__ == "__main__":
    main()
