"""The solver on a GPU: agreement with the CPU, time of a frame, and share of the memory bandwidth.

    python benchmarks/on_a_gpu.py [--device cuda] [--particles 3000 30000 ...] [--frames 50] [--time 600]

First it advances each of 50 states of 3,000 particles that strike a ball, a mesh or a neural surface by one frame, and
compares with the C++ code on the CPU. Then, for every size, it simulates the scene of against_solver.py on the device,
without copies to the host, and prints milliseconds a frame, peak memory, and the least memory traffic of a frame (see
`least_traffic`) as a share of the device's copy speed, which is measured in the same run. A size is left out if it
would probably exceed `--time` seconds in all.

On a GPU the results are written to `benchmarks/results/on_a_gpu.json`. `--device cpu` tries all of it on Warp's CPU
device and writes nothing.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import torch

from against_solver import scene_of
from record import write_result
from surfsup.errors import InputError
from surfsup.sph.device import choose_device
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import SUBSTEPS, ParticleState
from surfsup.sph.warp_engine.solver import WarpSolver

EQUAL_FRAMES, EQUAL_PARTICLES = 50, 3_000
SOLIDS = ("ball", "knot", "coral")  # a closed form, a mesh, a network
IMPACT = 20  # frames before those that are compared
WARM_UP = 3  # frames before those that are timed; the first is recorded
SIZES = (3_000, 30_000, 300_000, 1_000_000, 3_000_000, 10_000_000)
COPIED_FLOATS = {"cuda": 2**28, "cpu": 2**24}
FLOAT = 4  # bytes


def start_of(particles: int, device: str, solid: str = "ball") -> tuple[ParticleState, Environment]:
    """The particles at the scene's start, and its environment, on the device."""
    scene = scene_of(particles, 1, solid)
    surface = scene.build_surface()
    start = scene.initial_particles(surface)
    state = (torch.from_numpy(values).to(device) for values in (start.positions, start.velocities))
    return ParticleState(*state), Environment.of(scene, surface, device)


def largest_difference(device: str, solid: str) -> float:
    """The largest distance in meters after a frame on the device and in C++ from the same state."""
    state, by_cpu = start_of(EQUAL_PARTICLES, "cpu", solid)
    _, there = start_of(EQUAL_PARTICLES, device, solid)
    solver, on_device, largest = DfsphSolver(), WarpSolver(), 0.0
    for frame in range(IMPACT + EQUAL_FRAMES):
        after, _ = solver.step(state, by_cpu)
        if frame >= IMPACT:
            before = ParticleState(state.positions.to(device), state.velocities.to(device))
            found, *_ = on_device.step(before, there)
            largest = max(largest, float((found.cpu() - after.positions).norm(dim=1).max()))
        state = after
    return largest


def copy_speed(device: str) -> float:
    """Bytes a second, read and written, of the fastest of ten copies of a large array."""
    source = torch.ones(COPIED_FLOATS[torch.device(device).type], device=device)
    target = torch.empty_like(source)
    best = float("inf")
    for _ in range(10):
        began = time.perf_counter()
        target.copy_(source)
        target[0].item()
        best = min(best, time.perf_counter() - began)
    return 2 * FLOAT * len(source) / best


def least_traffic(particles: int, pairs: int) -> int:
    """Least number of bytes that a frame reads and writes, if each pass moves every array that it needs once.

    Each substep passes over the pairs twice: for density it reads index, position and velocity of the neighbor, for the
    pressure forces index, position and pressure. It also reads and writes position, velocity and pressure of every
    particle.
    """
    per_pair = (1 + 6) + (1 + 4)
    per_particle = 2 * (6 + 4)
    return FLOAT * SUBSTEPS * (pairs * per_pair + particles * per_particle)


def measure(particles: int, frames: int, device: str) -> dict[str, Any]:
    """Number of particles and of neighbor pairs, seconds a frame and peak memory in bytes."""
    state, environment = start_of(particles, device)
    solver = WarpSolver()
    for _ in range(WARM_UP):
        state = ParticleState(*solver.step(state, environment)[:2])
    on_gpu = torch.device(device).type == "cuda"
    before = torch.cuda.mem_get_info(device)[0] if on_gpu else 0
    began = time.perf_counter()
    for _ in range(frames):
        state = ParticleState(*solver.step(state, environment)[:2])  # waits for the device at its end
    seconds = (time.perf_counter() - began) / frames
    used = torch.cuda.mem_get_info(device)[1] - before if on_gpu else 0
    return {"particles": len(state.positions), "pairs": solver.pairs, "seconds": seconds, "memory": used}


def main() -> None:
    """Print the difference, then a line for each size; write the results of a GPU."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default=None, help="a GPU where there is one")
    parser.add_argument("--particles", type=int, nargs="+", default=SIZES)
    parser.add_argument("--frames", type=int, default=50)
    parser.add_argument("--time", type=float, default=600, help="seconds in all")
    arguments = parser.parse_args()
    began = time.perf_counter()
    torch.set_grad_enabled(False)
    device = choose_device(arguments.device)
    on_gpu = torch.device(device).type == "cuda"
    name = torch.cuda.get_device_name(device) if on_gpu else device
    print(name, flush=True)
    differences = {}
    for solid in SOLIDS:
        differences[solid] = largest_difference(device, solid)
        print(
            f"{solid}, {EQUAL_FRAMES} frames from equal states: {differences[solid]:.1e} m from C++ at most", flush=True
        )
    speed = copy_speed(device)
    print(f"copy speed {speed / 1e9:.0f} GB/s", flush=True)
    rows: list[dict[str, Any]] = []
    cost = 0.0  # seconds a particle, all frames and the set-up
    for particles in sorted(arguments.particles):
        elapsed = time.perf_counter() - began
        if elapsed + cost * particles > arguments.time:
            print(f"{particles} particles: left out, {arguments.time - elapsed:.0f} s are left", flush=True)
            continue
        try:
            row = measure(particles, arguments.frames, device)
        except InputError as error:
            print(f"{particles} particles: {error}", flush=True)
            break
        cost = (time.perf_counter() - began - elapsed) / row["particles"]
        row["share"] = least_traffic(row["particles"], row["pairs"]) / row["seconds"] / speed
        row["substeps"] = SUBSTEPS * row["particles"] / row["seconds"]
        rows.append(row)
        memory = f", {row['memory'] / 1e9:.2f} GB" if on_gpu else ""
        print(
            f"{row['particles']} particles, {row['pairs']} pairs: {1000 * row['seconds']:.2f} ms a frame, "
            f"{row['substeps'] / 1e6:.1f} million particle-substeps/s{memory}; "
            f"{100 * row['share']:.1f} % of the copy speed",
            flush=True,
        )
    if on_gpu and rows:
        best = max(rows, key=lambda row: row["substeps"])
        write_result(
            "on_a_gpu",
            f"Particle-substeps a second on {name}, {best['particles']:,} particles",
            round(best["substeps"] / 1e6, 1),
            "million/s",
            "the least memory traffic at the device's copy speed",
            round(best["substeps"] / best["share"] / 1e6, 1),
            "python benchmarks/on_a_gpu.py",
            values={"device": name, "difference_m": differences, "copy_gb_per_s": speed / 1e9, "sizes": rows},
        )


if __name__ == "__main__":
    main()
