"""Time and memory against the number of particles: the default model, native, and SPlisHSPlasH with its fixed step.

    python benchmarks/growth.py [--particles 3000 ... 1000000] [--solver 3000 ...] [--threads 2] [--frames 10]
                                [--rounds 3] [--figure docs/images/growth.png] [--long 10000]

The scene is that of against_solver.py: a block of 14 layers, as wide as it takes, above a ball. Every case is a process
of its own, all take turns for so many rounds, and of each the best counts: other guests of a host are felt. Ours counts
everything, writing included, and its peak memory, the solver's bare steps count. With --long a rollout of as many
frames of 3,000 particles tells whether memory stays constant.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from against_solver import ours, scene_of, solver

OURS, SOLVER = (3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000), (3_000, 10_000, 30_000, 100_000)
FRAMES_OF_SOLVER = 4  # it is slow where it is large: so many are timed


def peak() -> float:
    """The most memory that this process had, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


def run(kind: str, particles: int, frames: int) -> dict[str, float]:
    """Particles, milliseconds a frame by the clock, and peak memory in GB, in this process."""
    scene = scene_of(particles, frames)
    count = len(scene.start(scene.build_surface()).positions)
    timing = ours(scene, None, native=True) if kind == "ours" else solver(scene, adaptive=False)
    return {"particles": count, "ms": timing[0], "memory": peak()}


def in_its_own_process(kind: str, particles: int, frames: int, threads: int) -> dict[str, float] | None:
    """The same in a process with so many threads; None where it fails, and why on standard error."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.json"
        command = [sys.executable, __file__, "--run", kind, str(particles), str(frames), str(result)]
        environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
        if kind == "solver":
            environment["OMP_WAIT_POLICY"] = "passive"
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"{kind} with {particles} particles failed: {done.stderr.strip()[-300:]}", file=sys.stderr)
            return None
        return json.loads(result.read_text())


def draw(cases: dict[str, list[dict[str, float]]], path: Path) -> None:
    """Time a frame and memory over the number of particles, both scales logarithmic."""
    import matplotlib.pyplot as plt

    figure, (time, memory) = plt.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    for name, rows in cases.items():
        counts = [row["particles"] for row in rows]
        time.plot(counts, [row["ms"] for row in rows], marker="o", label=name)
        memory.plot(counts, [row["memory"] for row in rows], marker="o", label=name)
    time.set(xlabel="particles", ylabel="ms a frame of 5 ms", xscale="log", yscale="log")
    memory.set(xlabel="particles", ylabel="peak memory, GB", xscale="log", yscale="log")
    for axes in (time, memory):
        axes.grid(alpha=0.3)
        axes.legend()
    figure.savefig(path, dpi=120)


def main() -> None:
    """Print a line a case, draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, nargs="*", default=OURS)
    parser.add_argument("--solver", type=int, nargs="*", default=SOLVER)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--frames", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--long", type=int, nargs="*", default=[], help="frames of rollouts of 3,000 particles")
    parser.add_argument("--figure", type=Path, default=None)
    parser.add_argument("--run", nargs=4, metavar=("KIND", "PARTICLES", "FRAMES", "RESULT"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        kind, particles, frames, result = arguments.run
        Path(result).write_text(json.dumps(run(kind, int(particles), int(frames))))
        return
    plan = [("ours", count, arguments.frames) for count in arguments.particles]
    plan += [("solver", count, FRAMES_OF_SOLVER + 2) for count in arguments.solver]
    best: dict[tuple[str, int], dict[str, float]] = {}
    for _ in range(arguments.rounds):
        for kind, particles, frames in plan:
            told = in_its_own_process(kind, particles, frames, arguments.threads)
            if told is not None and told["ms"] < best.get((kind, particles), {"ms": math.inf})["ms"]:
                best[kind, particles] = told
    cases: dict[str, list[dict[str, float]]] = {"ours": [], "solver": []}
    for (kind, _), told in best.items():
        cases[kind].append(told)
        each = 1000 * told["ms"] / told["particles"]
        print(
            f"{kind}: {told['particles']:.0f} particles, {told['ms']:.1f} ms a frame, {each:.2f} µs a particle, "
            f"{told['memory']:.2f} GB at most",
            flush=True,
        )
    for frames in arguments.long:
        told = in_its_own_process("ours", 3_000, frames, arguments.threads)
        if told is not None:
            print(f"ours: {frames} frames, {told['ms']:.2f} ms a frame, {told['memory']:.3f} GB at most", flush=True)
    if arguments.figure is not None:
        draw({name: rows for name, rows in cases.items() if rows}, arguments.figure)


if __name__ == "__main__":
    main()
