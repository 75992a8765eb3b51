"""Time of a whole data set against the bare steps of SPlisHSPlasH: same scenes, same cores, in one run.

    python benchmarks/generation.py [-n 8] [--workers 2] [--frames 800]

The whole is the command ``surfsup generate`` from start to end: sampling scenes, boundary volume maps, starting
solvers, reading frames, checks, compression, writing. The bare steps run the same scenes in as many solvers side by
side; only the time from the first step to the last counts, and no frame is read. Their total assigns each scene, in
order, to the core that becomes free first.

The program also reports the size of the files and the time to read a random window of six frames.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from surfsup.io.trajectory import Trajectory
from surfsup.sph.boundary.scene_boundaries import scene_volume_maps
from surfsup.sph.state import SUBSTEPS
from surfsup.splishsplash.job_files import write_job

RECIPE, SEED = "prim-shapes", "11"
WINDOW = 6  # frames
READS = 300


def step_only(scene_file: str, steps: int) -> None:
    """In a process of its own: run ``steps`` steps and print the seconds that they took."""
    from surfsup.splishsplash.library import load_solver

    solver = load_solver()
    base = solver.Exec.SimulatorBase()
    log = str(Path(scene_file).parent / "log")
    base.init(sceneFile=scene_file, programName="bare", useCache=False, outputDir=log, useGui=False, stopAt=-1.0)
    base.initSimulation()
    base.setValueFloat(base.STOP_AT, 1e9)
    done, began, ended = 0, 0.0, 0.0

    def after_step() -> None:
        nonlocal done, began, ended
        done += 1
        if done == 1:
            began = time.perf_counter()  # what is set up late is over now
        if done == steps:
            ended = time.perf_counter()
            base.setValueFloat(base.STOP_AT, 1e-9)

    base.setTimeStepCB(after_step)
    base.runSimulation()
    sys.stderr.write(f"\n{(ended - began) * steps / (steps - 1)}\n")


def bare_seconds(job: Path, frames: int) -> float:
    """Seconds that the bare steps of one scene take, with whatever else runs beside."""
    steps = (frames - 1) * SUBSTEPS
    command = [sys.executable, __file__, "--step-only", str(job), str(steps)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OMP_WAIT_POLICY": "passive"}
    done = subprocess.run(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=True
    )
    return float(done.stderr.split()[-1])


def write_jobs(paths: list[Path], folder: Path) -> list[Path]:
    """The solver's input for the scenes of the trajectories in ``paths``."""
    jobs = []
    for path in paths:
        with Trajectory(path) as trajectory:
            scene = trajectory.scene
        surface = scene.build_surface()
        start = scene.initial_particles(surface)
        home = folder / path.stem
        home.mkdir()
        maps = scene_volume_maps(scene, surface)
        jobs.append(write_job(home, scene.gravity, start.block_positions, start.block_velocities, maps))
    return jobs


def seconds_in_all(each: list[float], cores: int) -> float:
    """End of the last job, if each begins as soon as a core is free."""
    free = [0.0] * cores
    for seconds in each:
        first = free.index(min(free))
        free[first] += seconds
    return max(free)


def window_milliseconds(paths: list[Path]) -> tuple[float, float]:
    """Median milliseconds to read a random window out of an open file, and with opening it."""
    random = np.random.default_rng(0)
    read, opened = [], []
    for _ in range(READS):
        before = time.perf_counter()
        with Trajectory(paths[random.integers(len(paths))]) as trajectory:
            first = int(random.integers(len(trajectory) - WINDOW + 1))
            begin = time.perf_counter()
            trajectory.window(first, WINDOW)
            read.append(time.perf_counter() - begin)
        opened.append(time.perf_counter() - before)
    return 1e3 * float(np.median(read)), 1e3 * float(np.median(opened))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("-n", type=int, default=8)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--frames", type=int, default=800)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        data, jobs = Path(scratch) / "data", Path(scratch) / "jobs"
        jobs.mkdir()
        numbers = {"-n": arguments.n, "--workers": arguments.workers, "--frames": arguments.frames, "--seed": SEED}
        options = [str(part) for option in numbers.items() for part in option]
        command = [sys.executable, "-m", "surfsup.cli", "generate", RECIPE, "-o", str(data), *options]
        began = time.perf_counter()
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        whole = time.perf_counter() - began

        paths = sorted(data.glob("*.h5"))
        with ThreadPoolExecutor(arguments.workers) as cores:
            each = list(cores.map(lambda job: bare_seconds(job, arguments.frames), write_jobs(paths, jobs)))
        bare = seconds_in_all(each, arguments.workers)
        print(f"{arguments.n} scenes of {arguments.frames} frames, {arguments.workers} at a time")
        print(f"bare steps   {bare:7.1f} s   ({sum(each) / len(each):.2f} s a scene)")
        print(f"whole        {whole:7.1f} s   throughput {bare / whole:.1%} of what the bare steps allow")

        raw = 0
        for path in paths:
            with Trajectory(path) as trajectory:
                raw += 2 * int(np.prod(trajectory.positions.shape)) * 4
        stored = sum(path.stat().st_size for path in paths)
        print(f"files        {stored / 1e6:7.1f} MB  {stored / raw:.1%} of raw float32")
        read, opened = window_milliseconds(paths)
        print(f"window       {read:7.2f} ms  of {WINDOW} random frames; {opened:.2f} ms with opening the file")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--step-only"]:
        step_only(sys.argv[2], int(sys.argv[3]))
    else:
        main()
