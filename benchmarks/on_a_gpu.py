"""The default simulator on a GPU: agreement with the CPU, time of a frame, and share of the memory bandwidth.

    python benchmarks/on_a_gpu.py [--device cuda] [--particles 3000 30000 300000 3000000] [--frames 20]

First it compares 50 frames of 3,000 particles with those of the native code on the CPU. Then, for every size, it
simulates the scene of against_solver.py and prints milliseconds a frame (including the copy of each frame to the host),
peak memory, and the least memory traffic of a frame (see `least_traffic`) as a share of the device's copy speed, which
is measured in the same run. `--device cpu` tries all of it on Warp's CPU device, without the native code.
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
from surfsup.simulation import Simulation
from surfsup.sph.device import choose_device
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.state import SUBSTEPS

EQUAL_FRAMES, EQUAL_PARTICLES = 50, 3_000
COPIED_FLOATS = 2**28  # floats, 1 GiB
FLOAT = 4  # bytes


def rollout(device: str) -> list[np.ndarray]:
    """Positions (N, 3) of the first frames."""
    scene = scene_of(EQUAL_PARTICLES, EQUAL_FRAMES)
    return [frame.positions for frame in Simulation(scene, device=device).run()]


def copy_speed(device: str) -> float:
    """Bytes a second, read and written, of the fastest of ten copies of a large array."""
    source = torch.ones(COPIED_FLOATS, device=device)
    target = torch.empty_like(source)
    best = float("inf")
    for _ in range(10):
        began = time.perf_counter()
        target.copy_(source)
        target[0].item()
        best = min(best, time.perf_counter() - began)
    return 2 * FLOAT * COPIED_FLOATS / best


def least_traffic(particles: int, edges: int) -> int:
    """Least number of bytes that a frame reads and writes, if each pass moves every array that it needs once.

    Each substep passes over the edges twice: for density it reads index, position and velocity of the neighbor, for the
    pressure forces index, position and pressure. It also reads and writes position, velocity and pressure of every
    particle.
    """
    per_edge = (1 + 6) + (1 + 4)
    per_particle = 2 * (6 + 4)
    return FLOAT * SUBSTEPS * (edges * per_edge + particles * per_particle)


def frame_time(particles: int, frames: int, device: str) -> tuple[int, float, int]:
    """Number of particles, seconds a frame without the first two frames, and number of edges in the last frame."""
    scene = scene_of(particles, frames + 2)
    run = Simulation(scene, device=device).run()
    for _ in islice(run, 2):
        pass
    began = time.perf_counter()
    (frame,) = deque(run, maxlen=1)
    took = (time.perf_counter() - began) / frames
    last = torch.from_numpy(frame.positions)
    return len(last), took, len(find_neighbors(last, KERNEL_SUPPORT).senders)


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
    native.instruction_sets = list  # from here on as if the package had been installed without a compiler
    errors = [np.linalg.norm(ours - theirs, axis=1) for ours, theirs in zip(rollout(device), by_cpu, strict=True)]
    largest, mean = max(map(np.max, errors)), max(map(np.mean, errors))
    print(f"{EQUAL_FRAMES} frames of {len(by_cpu[0])} particles: difference from the native code on the CPU", end=" ")
    print(f"{largest:.1e} m at most, {mean:.1e} m on average", flush=True)
    speed = copy_speed(device)
    print(f"copy speed {speed / 1e9:.0f} GB/s", flush=True)
    for particles in arguments.particles:
        if on_gpu:
            torch.cuda.reset_peak_memory_stats(device)
        count, seconds, edges = frame_time(particles, arguments.frames, device)
        memory = f", {torch.cuda.max_memory_allocated(device) / 1e9:.2f} GB at most" if on_gpu else ""
        share = least_traffic(count, edges) / seconds / speed
        times = f"{1000 * seconds:.2f} ms a frame, {1e6 * seconds / count:.3f} µs a particle"
        print(f"{count} particles, {edges} edges: {times}{memory}; {100 * share:.1f} % of the copy speed", flush=True)


if __name__ == "__main__":
    main()
