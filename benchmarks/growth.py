"""Time and memory over the number of particles: surfsup's solver, native, and SPlisHSPlasH with its fixed step.

    python benchmarks/growth.py [--particles 3000 ... 1000000] [--solver 3000 ...] [--threads 2] [--frames 10]
                                [--rounds 3] [--figure docs/images/growth.png] [--long 10000]

The scene is that of against_solver.py: a block of 14 layers, as wide as needed, above a ball. Every case is a process
of its own. Each round runs all cases, and the best round of a case counts, since a shared host disturbs the times. The
time of surfsup includes everything, writing included; that of SPlisHSPlasH includes only its steps. With `--long`,
rollouts of 3,000 particles over that many frames show whether the memory stays constant.

The result is written to `benchmarks/results/growth.json`.
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

from against_solver import scene_of, time_splishsplash, time_surfsup
from record import write_result
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR

SURFSUP, SPLISHSPLASH = "surfsup", "SPlisHSPlasH"
SURFSUP_PARTICLES = (3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
SPLISHSPLASH_PARTICLES = (3_000, 10_000, 30_000, 100_000)
SPLISHSPLASH_FRAMES = 4  # few, since large scenes take long

Case = dict[str, float]  # particles, ms a frame by the clock, peak memory in GB


def peak_memory() -> float:
    """The peak memory of this process, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


def run(name: str, particles: int, frames: int) -> Case:
    """One case, in this process."""
    scene = scene_of(particles, frames)
    count = len(scene.initial_particles(scene.build_surface()).positions)
    if name == SURFSUP:
        timing = time_surfsup(scene, DEFAULT_SIMULATOR, use_native=True)
    else:
        timing = time_splishsplash(scene, adaptive=False)
    return {"particles": count, "ms": timing[0], "memory": peak_memory()}


def run_in_own_process(name: str, particles: int, frames: int, threads: int) -> Case | None:
    """One case in a process with ``threads`` threads; None if it fails, with the reason on standard error."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.json"
        command = [sys.executable, __file__, "--run", name, str(particles), str(frames), str(result)]
        environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
        if name == SPLISHSPLASH:
            environment["OMP_WAIT_POLICY"] = "passive"
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"{name} with {particles} particles failed: {done.stderr.strip()[-300:]}", file=sys.stderr)
            return None
        return json.loads(result.read_text())


def microseconds_per_particle(case: Case) -> float:
    """Time of a frame divided by the number of particles."""
    return 1000 * case["ms"] / case["particles"]


def draw(cases: dict[str, list[Case]], path: Path) -> None:
    """Time of a frame and memory over the number of particles, both scales logarithmic."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure, (time, memory) = plt.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    for name, rows in cases.items():
        counts = [row["particles"] for row in rows]
        time.plot(counts, [row["ms"] for row in rows], marker="o", label=name)
        memory.plot(counts, [row["memory"] for row in rows], marker="o", label=name)
    time.set(xlabel="particles", ylabel="ms for a frame of 5 ms", xscale="log", yscale="log")
    memory.set(xlabel="particles", ylabel="peak memory, GB", xscale="log", yscale="log")
    for axes in (time, memory):
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(LogLocator(subs=(1, 2, 5) if axis is axes.yaxis else (1, 3)))
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.7g}"))
            axis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
        axes.legend()
    figure.savefig(path, dpi=120)


def write(cases: dict[str, list[Case]], long: dict[int, Case], threads: int, command: str) -> None:
    """Write the largest case of surfsup beside the largest of SPlisHSPlasH."""
    largest, peer = cases[SURFSUP][-1], cases[SPLISHSPLASH][-1] if cases[SPLISHSPLASH] else None
    write_result(
        "growth",
        f"Time of a frame per particle at {largest['particles']:,.0f} particles "
        f"(peak memory {largest['memory']:.2f} GB)",
        round(microseconds_per_particle(largest), 2),
        "µs",
        f"SPlisHSPlasH, fixed step of 1 ms, at {peer['particles']:,.0f} particles" if peer else None,
        round(microseconds_per_particle(peer), 2) if peer else None,
        command,
        values={**cases, "long_rollouts": {str(frames): case for frames, case in long.items()}},
        threads=threads,
    )


def main() -> None:
    """Print a line for each case, draw the figure, write the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, nargs="*", default=SURFSUP_PARTICLES)
    parser.add_argument("--solver", type=int, nargs="*", default=SPLISHSPLASH_PARTICLES)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--frames", type=int, default=10)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--long", type=int, nargs="*", default=[], help="frames of rollouts of 3,000 particles")
    parser.add_argument("--figure", type=Path, default=None)
    parser.add_argument("--run", nargs=4, metavar=("NAME", "PARTICLES", "FRAMES", "RESULT"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        name, particles, frames, result = arguments.run
        Path(result).write_text(json.dumps(run(name, int(particles), int(frames))))
        return
    plan = [(SURFSUP, count, arguments.frames) for count in arguments.particles]
    plan += [(SPLISHSPLASH, count, SPLISHSPLASH_FRAMES + 2) for count in arguments.solver]
    best: dict[tuple[str, int], Case] = {}
    for _ in range(arguments.rounds):
        for name, particles, frames in plan:
            case = run_in_own_process(name, particles, frames, arguments.threads)
            if case is not None and case["ms"] < best.get((name, particles), {"ms": math.inf})["ms"]:
                best[name, particles] = case
    cases: dict[str, list[Case]] = {SURFSUP: [], SPLISHSPLASH: []}
    for (name, _), case in best.items():
        cases[name].append(case)
        print(
            f"{name}: {case['particles']:.0f} particles, {case['ms']:.1f} ms a frame, "
            f"{microseconds_per_particle(case):.2f} µs a particle, {case['memory']:.2f} GB at most",
            flush=True,
        )
    long = {}
    for frames in arguments.long:
        case = run_in_own_process(SURFSUP, 3_000, frames, arguments.threads)
        if case is not None:
            long[frames] = case
            print(f"{frames} frames: {case['ms']:.2f} ms a frame, {case['memory']:.3f} GB at most", flush=True)
    if cases[SURFSUP]:
        write(cases, long, arguments.threads, " ".join(["python benchmarks/growth.py", *sys.argv[1:]]))
    if arguments.figure is not None:
        draw({name: rows for name, rows in cases.items() if rows}, arguments.figure)


if __name__ == "__main__":
    main()
