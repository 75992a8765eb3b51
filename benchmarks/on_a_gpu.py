"""The default model on a GPU: is it right, how long does a frame take, and how near is that to what memory allows.

    python benchmarks/on_a_gpu.py [--device cuda] [--particles 3000 30000 300000 3000000] [--frames 20]

First 50 frames of 3,000 particles beside the CPU's native ones. Then, for every size, the scene of against_solver.py:
milliseconds a frame (everything counts, the way of each frame back to the host too), peak memory, and what a frame has
to move at least (see `least_traffic`) in that time, as a share of what the device copies a second, measured in the same
run. `--device cpu` tries all of it but the search for neighbors, without the native step.
"""

from __future__ import annotations

import argparse
import time
from collections import deque
from itertools import islice

import numpy as np
import torch

from against_solver import scene_of
from surfsup import native
from surfsup.learned import weights_file
from surfsup.simulation import choose_device, simulate
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import SOLVER_STEPS

EQUAL_FRAMES, EQUAL_PARTICLES = 50, 3_000
COPIED = 2**28  # floats, 1 GiB
FLOAT = 4  # bytes


def rollout(device: str) -> list[np.ndarray]:
    """Positions (N, 3) of the first frames, by a model loaded anew: it keeps whether it steps natively."""
    scene = scene_of(EQUAL_PARTICLES, EQUAL_FRAMES)
    surface = scene.build_surface()
    return [positions for positions, _ in simulate(load(), scene, surface, scene.start(surface), device)]


def load() -> Simulator:
    """The default model."""
    return weights_file.load(weights_file.find(weights_file.DEFAULT_MODEL))[0]


def copied_a_second(device: str) -> float:
    """Bytes read and written a second by the best of ten copies of a large array."""
    source = torch.ones(COPIED, device=device)
    target = torch.empty_like(source)
    best = float("inf")
    for _ in range(10):
        began = time.perf_counter()
        target.copy_(source)
        target[0].item()
        best = min(best, time.perf_counter() - began)
    return 2 * FLOAT * COPIED / best


def least_traffic(particles: int, edges: int, channels: int) -> int:
    """Bytes that a frame of the rule has to move, were every array read or written once in each pass that needs it.

    Each of the steps goes over the edges twice: for density, who it is, its place and velocity; for the pressures, who
    it is, its place and pressure; and over the particles, whose place, velocity and pressure are read and written. The
    network goes over the edges once, for who it is, its place and what it tells.
    """
    an_edge = (1 + 6) + (1 + 4)
    a_particle = 2 * (6 + 4)
    told = 1 + 3 + channels
    return FLOAT * (SOLVER_STEPS * (edges * an_edge + particles * a_particle) + edges * told)


def frame_time(particles: int, frames: int, device: str) -> tuple[int, float, int]:
    """How many particles there are, seconds a frame but for the first two, and edges in the last."""
    scene = scene_of(particles, frames + 2)
    surface = scene.build_surface()
    start = scene.start(surface)
    model = load()
    run = simulate(model, scene, surface, start, device)
    for _ in islice(run, 2):
        pass
    began = time.perf_counter()
    ((positions, _),) = deque(run, maxlen=1)
    took = (time.perf_counter() - began) / frames
    last = torch.from_numpy(positions)
    return len(last), took, len(find_neighbors(last, model.architecture.radius).senders)


def main() -> None:
    """Print the difference, then a line for each size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default=None, help="a GPU where there is one")
    parser.add_argument("--particles", type=int, nargs="+", default=[3_000, 30_000, 300_000, 3_000_000])
    parser.add_argument("--frames", type=int, default=20)
    arguments = parser.parse_args()
    torch.set_grad_enabled(False)
    device = choose_device(arguments.device)
    on_gpu = torch.device(device).type == "cuda"
    print(torch.cuda.get_device_name(device) if on_gpu else device, flush=True)
    by_cpu = rollout("cpu")
    native.instruction_sets = list  # as if it had been built without a compiler: from here on all is torch's
    off = [np.linalg.norm(ours - theirs, axis=1) for ours, theirs in zip(rollout(device), by_cpu, strict=True)]
    told = f"{max(map(np.max, off)):.1e} m at most, {max(map(np.mean, off)):.1e} m on the mean"
    print(f"{EQUAL_FRAMES} frames of {len(by_cpu[0])} particles: off the CPU's native ones by {told}", flush=True)
    copied = copied_a_second(device)
    print(f"copies {copied / 1e9:.0f} GB a second", flush=True)
    channels = load().architecture.messages
    for particles in arguments.particles:
        if on_gpu:
            torch.cuda.reset_peak_memory_stats(device)
        count, seconds, edges = frame_time(particles, arguments.frames, device)
        memory = f", {torch.cuda.max_memory_allocated(device) / 1e9:.2f} GB at most" if on_gpu else ""
        share = least_traffic(count, edges, channels) / seconds / copied
        each = f"{1000 * seconds:.2f} ms a frame, {1e6 * seconds / count:.3f} µs a particle"
        told = f"{count} particles, {edges} edges: {each}{memory}; {100 * share:.1f} % of what copying reaches"
        print(told, flush=True)


if __name__ == "__main__":
    main()
