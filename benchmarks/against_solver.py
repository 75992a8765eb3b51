"""Time of a frame of 5 ms: surfsup's solver, in C++ and in Warp, against SPlisHSPlasH on the same scene and cores.

    python benchmarks/against_solver.py [--particles 3000 50000] [--threads 1 2] [--frames 200] [--rounds 3]
                                        [--surface ball knot coral chair] [--no-warp] [--simulator NAME]

A block of water falls on a ball, a mesh or a neural surface of the same height. Every run is a process of its own, and
the runs of a round follow each other. The time of surfsup includes everything: neighbor search, pressure solve,
distances, collision handling, and writing the trajectory. The time of SPlisHSPlasH includes only its steps, without
reading or writing: with a fixed step of 1 ms (five a frame, the setting of the paper), and with its adaptive step
(CFL condition, its default). Set-up, up to the end of the first frame, is excluded on both sides. Every time is given
as wall clock, and in brackets as processor time of all threads. At 50,000 particles a round takes five minutes for
each number of threads. `--no-warp` leaves out the run without the C++ code.

The results are written to `benchmarks/results/speed_*.json`.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from record import write_result
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import FRAME_TIME, Scene
from surfsup.sph.boundary.scene_boundaries import scene_volume_maps
from surfsup.sph.liquid import LiquidForces
from surfsup.sph.state import SUBSTEPS
from surfsup.splishsplash.job_files import write_job

Timing = tuple[float, float]  # wall-clock and processor milliseconds of a frame
CFL = 1  # number of the adaptive step in SPlisHSPlasH
SPACING, LAYERS = 0.03, 14
FRAMES = 200
RADIUS = 0.3  # meters, of the ball
EXTENT = 2 * RADIUS
MESH = Path(__file__).parent.parent / "examples" / "knot.obj"
SURFACES: dict[str, dict[str, Any]] = {
    "ball": {"sphere": {"radius": RADIUS}, "at": [0, 0, RADIUS]},
    "knot": {"mesh": {"file": str(MESH), "fit": EXTENT}},
    "coral": {"siren": {"file": "coral", "fit": EXTENT}},
    "chair": {"deepsdf": {"file": "chairs", "shape": "chair-0100", "fit": EXTENT}, "at": [0, 0, RADIUS]},
}
TITLES = {"ball": "a ball", "knot": "a knot (mesh)", "coral": "a coral (SIREN)", "chair": "a chair (DeepSDF)"}
FIXED, ADAPTIVE, NATIVE, WARP = "SPlisHSPlasH 1 ms", "SPlisHSPlasH CFL", "native", "Warp"


def scene_of(particles: int, frames: int, surface: str = "ball") -> Scene:
    """A block of about ``particles`` particles above a solid; it has 14 layers and is as wide as needed."""
    side = SPACING * (round((particles / LAYERS) ** 0.5) + 1) + 1e-4
    height = SPACING * (LAYERS + 1) + 1e-4
    width, bottom = max(1.0, 1.5 * side), EXTENT + 0.05
    block = {"min": [-side / 2, -side / 2, bottom], "max": [side / 2, side / 2, bottom + height]}
    description = {
        "container": {"size": [width, width, 2.0]},
        "surface": SURFACES[surface],
        "fluid": [{"block": block}],
        "frames": frames,
    }
    return Scene.from_yaml(json.dumps(description), "the benchmark's scene", Path())


def mean_timing(frame: Callable[[], Any], frames: int) -> Timing:
    """The mean time of ``frames`` calls."""
    wall, processor = time.perf_counter(), time.process_time()
    for _ in range(frames):
        frame()
    return 1000 * (time.perf_counter() - wall) / frames, 1000 * (time.process_time() - processor) / frames


def time_surfsup(scene: Scene, simulator_name: str, use_native: bool) -> Timing:
    """A rollout that is written frame by frame, in this process."""
    from surfsup import native
    from surfsup.io.trajectory_format import Provenance
    from surfsup.io.trajectory_writer import TrajectoryWriter
    from surfsup.simulation import Simulation

    if not use_native:
        native.instruction_sets = list  # as if the package had been installed without a compiler
    frames = Simulation(scene, simulator_name, "cpu").run()
    start = scene.initial_particles(scene.build_surface())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trajectory.h5"
        with TrajectoryWriter(path, scene, Provenance("benchmark"), len(start.positions)) as writer:

            def write_frame() -> None:
                frame = next(frames)
                writer.append(frame.positions, frame.velocities)

            write_frame()
            write_frame()
            return mean_timing(write_frame, scene.frames - 2)


def time_splishsplash(scene: Scene, adaptive: bool) -> Timing:
    """The steps of SPlisHSPlasH in this process; OMP_NUM_THREADS sets its number of threads."""
    from surfsup.splishsplash.library import load_solver

    surface = scene.build_surface()
    start = scene.initial_particles(surface)
    library = load_solver()
    with tempfile.TemporaryDirectory() as folder:
        path = write_job(
            Path(folder),
            scene.gravity,
            start.block_positions,
            start.block_velocities,
            scene_volume_maps(scene, surface),
            liquid=LiquidForces.of(scene.liquid),
        )
        if adaptive:
            job = json.loads(path.read_text())
            job["Configuration"]["cflMethod"] = CFL
            path.write_text(json.dumps(job))
        base = library.Exec.SimulatorBase()
        base.init(
            sceneFile=str(path),
            programName="surfsup",
            useCache=False,
            outputDir=str(Path(folder) / "log"),
            initialPause=False,
            useGui=False,
            stopAt=-1.0,
        )
        base.initSimulation()
        base.setValueFloat(base.STOP_AT, (scene.frames - 1) * FRAME_TIME)
        began: list[float] = []

        def after_step() -> None:
            # The first frame includes the set-up.
            if not began and library.TimeManager.getCurrent().getTime() > FRAME_TIME * (1 - 0.5 / SUBSTEPS):
                began.extend([library.TimeManager.getCurrent().getTime(), time.perf_counter(), time.process_time()])

        base.setTimeStepCB(after_step)
        base.runSimulation()
        frames = (library.TimeManager.getCurrent().getTime() - began[0]) / FRAME_TIME
        timing = 1000 * (time.perf_counter() - began[1]) / frames, 1000 * (time.process_time() - began[2]) / frames
        base.cleanup()
        return timing


RUNS: dict[str, Callable[[Scene, str], Timing]] = {
    FIXED: lambda scene, _: time_splishsplash(scene, adaptive=False),
    ADAPTIVE: lambda scene, _: time_splishsplash(scene, adaptive=True),
    WARP: lambda scene, simulator: time_surfsup(scene, simulator, use_native=False),
    NATIVE: lambda scene, simulator: time_surfsup(scene, simulator, use_native=True),
}


def run_in_own_process(name: str, scene: Scene, threads: int, simulator: str) -> Timing:
    """The timing of one run, measured in a process with ``threads`` threads."""
    with tempfile.TemporaryDirectory() as folder:
        path, result = Path(folder) / "scene.yaml", Path(folder) / "result.json"
        path.write_text(scene.to_yaml())
        command = [sys.executable, __file__, "--run", name, str(path), str(result), "--simulator", simulator]
        environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
        if name in (FIXED, ADAPTIVE):
            environment["OMP_WAIT_POLICY"] = "passive"
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{name} failed: {done.stderr.strip()[-500:]}")
        wall, processor = json.loads(result.read_text())
        return wall, processor


def compare(scene: Scene, surface: str, particles: int, threads: int, arguments: argparse.Namespace) -> None:
    """Time one scene with one number of threads, print all rounds, write the medians."""
    count = len(scene.initial_particles(scene.build_surface()).positions)
    names = (FIXED, ADAPTIVE, NATIVE, *((WARP,) if arguments.warp else ()))
    rounds = []
    for _ in range(arguments.rounds):
        timings = {name: run_in_own_process(name, scene, threads, arguments.simulator) for name in names}
        rounds.append(timings)
        print(
            f"{surface}, {count} particles, {arguments.frames} frames, {threads} threads; ms wall (processor): "
            + ", ".join(f"{name} {wall:.2f} ({processor:.2f})" for name, (wall, processor) in timings.items()),
            flush=True,
        )
    walls = {name: [timings[name][0] for timings in rounds] for name in names}
    medians = {name: statistics.median(values) for name, values in walls.items()}
    to_fixed, to_adaptive = medians[FIXED] / medians[NATIVE], medians[ADAPTIVE] / medians[NATIVE]
    print(f"  medians: {to_fixed:.2f} times as fast as the fixed step, {to_adaptive:.2f} times as CFL", flush=True)
    if arguments.simulator != DEFAULT_SIMULATOR:
        return
    parts = [f"speed_{particles}", *([surface] if surface != "ball" else [])]
    parts += [f"{threads}_threads"] if threads != 1 else []
    write_result(
        "_".join(parts),
        f"Time of a frame of 5 ms, {count:,} particles falling on {TITLES[surface]}, "
        + ("one thread" if threads == 1 else f"{threads} threads"),
        round(medians[NATIVE], 2),
        "ms",
        "SPlisHSPlasH, fixed step of 1 ms",
        round(medians[FIXED], 2),
        f"python benchmarks/against_solver.py --particles {particles} --threads {threads} --no-warp"
        + (f" --surface {surface}" if surface != "ball" else "")
        + (f" --frames {arguments.frames}" if arguments.frames != FRAMES else ""),
        values={
            "particles": count,
            "frames": arguments.frames,
            "ms": {name: [round(value, 2) for value in values] for name, values in walls.items()},
            "ratio_fixed": round(to_fixed, 2),
            "ratio_cfl": round(to_adaptive, 2),
        },
        threads=threads,
    )


def main() -> None:
    """Run all, print the times and ratios, write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, nargs="+", default=[3000, 50000])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--frames", type=int, default=FRAMES, help="the first 20 are free fall, easy for the peer")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--surface", choices=SURFACES, nargs="+", default=["ball"])
    parser.add_argument("--simulator", default=DEFAULT_SIMULATOR, help="name or weights file")
    parser.add_argument(
        "--warp", action=argparse.BooleanOptionalAction, default=True, help="also time it without the native code"
    )
    parser.add_argument("--run", nargs=3, metavar=("NAME", "SCENE", "RESULT"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        name, path, result = arguments.run
        Path(result).write_text(json.dumps(RUNS[name](Scene.load(Path(path)), arguments.simulator)))
        return
    for surface, particles in itertools.product(arguments.surface, arguments.particles):
        scene = scene_of(particles, arguments.frames, surface)
        for threads in arguments.threads:
            compare(scene, surface, particles, threads, arguments)


if __name__ == "__main__":
    main()
