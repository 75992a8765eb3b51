"""Milliseconds a frame of 5 ms: the shipped model, native and in torch, against SPlisHSPlasH, same scene, same cores.

    python benchmarks/against_solver.py [--particles 3000 50000] [--threads 1 2] [--frames 200] [--no-torch]
                                        [--surface ball knot coral chair]

A block of water falls on a ball, or on a mesh or a neural surface as high; every run is a process of its own, one after
the other. Ours counts everything:
neighbors, network, distances, guard, and writing the trajectory. The solver's bare steps count, nothing read from it
or written: with its fixed step of 1 ms (five a frame, the paper's setting) and with its own adaptive step by the CFL
condition (its defaults). Set-up is left out on both sides, that is all up to the end of the first frame. ms is
wall-clock time, and 'cpu' processor time of all threads. Last, where a native frame's time goes. At 50,000 particles
it takes some five minutes for each number of threads, most of it in torch (`--no-torch`).
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from surfsup.scene import FRAME_TIME, Scene
from surfsup.sph.boundary.scene_boundaries import boundaries
from surfsup.splishsplash.job_files import STEPS_PER_FRAME, write_job

Timing = tuple[float, float]  # wall-clock and processor milliseconds a frame
CFL = 1  # SPlisHSPlasH's adaptive step
SPACING, LAYERS = 0.03, 14
RADIUS = 0.3  # meters of the ball
EXTENT = 2 * RADIUS
MESH = Path(__file__).parent.parent / "examples" / "knot.obj"
SURFACES: dict[str, dict[str, Any]] = {
    "ball": {"sphere": {"radius": RADIUS}, "at": [0, 0, RADIUS]},
    "knot": {"mesh": {"file": str(MESH), "fit": EXTENT}},
    "coral": {"siren": {"file": "coral", "fit": EXTENT}},
    "chair": {"deepsdf": {"file": "chairs", "shape": "chair-0100", "fit": EXTENT}, "at": [0, 0, RADIUS]},
}


def scene_of(particles: int, frames: int, surface: str = "ball") -> Scene:
    """A block of about so many particles, as high as those of the training scenes, above a solid; more: it is wider."""
    side = SPACING * (round((particles / LAYERS) ** 0.5) + 1) + 1e-4
    height = SPACING * (LAYERS + 1) + 1e-4
    width, bottom = max(1.0, 1.5 * side), EXTENT + 0.05
    block = {"min": [-side / 2, -side / 2, bottom], "max": [side / 2, side / 2, bottom + height]}
    return Scene.from_yaml(
        json.dumps(
            {
                "container": {"size": [width, width, 2.0]},
                "surface": SURFACES[surface],
                "fluid": [{"block": block}],
                "frames": frames,
            }
        ),
        "the benchmark's scene",
        Path(),
    )


def timed(frame: Callable[[], Any], frames: int) -> Timing:
    """The mean of so many frames."""
    wall, processor = time.perf_counter(), time.process_time()
    for _ in range(frames):
        frame()
    return 1000 * (time.perf_counter() - wall) / frames, 1000 * (time.process_time() - processor) / frames


def ours(scene: Scene, model_name: str | None, native: bool) -> Timing:
    """A rollout that is written as it is made."""
    from surfsup import native as built
    from surfsup.io.trajectory import Provenance, TrajectoryWriter
    from surfsup.learned import weights_file
    from surfsup.simulation import simulate

    if not native:
        built.paths = list  # as if it had been built without a compiler
    surface = scene.build_surface()
    start = scene.start(surface)
    model, _ = weights_file.load(weights_file.find(model_name or weights_file.DEFAULT_MODEL))
    frames = simulate(model, scene, surface, start, "cpu")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trajectory.h5"
        with TrajectoryWriter(path, scene, Provenance("benchmark"), len(start.positions)) as writer:
            writer.append(*next(frames))
            writer.append(*next(frames))
            return timed(lambda: writer.append(*next(frames)), scene.frames - 2)


def solver(scene: Scene, adaptive: bool) -> Timing:
    """Bare steps of SPlisHSPlasH in this process, by its own clock; its threads are those of the environment."""
    from surfsup.splishsplash.library import load_solver

    surface = scene.build_surface()
    start = scene.start(surface)
    library = load_solver()
    with tempfile.TemporaryDirectory() as folder:
        path = write_job(Path(folder), scene.gravity, start.blocks, start.velocities, boundaries(scene, surface))
        if adaptive:
            told = json.loads(path.read_text())
            told["Configuration"]["cflMethod"] = CFL
            path.write_text(json.dumps(told))
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
        end = (scene.frames - 1) * FRAME_TIME
        base.setValueFloat(base.STOP_AT, end)
        began: list[float] = []

        def after_step() -> None:
            # The first frame carries the set-up.
            if not began and library.TimeManager.getCurrent().getTime() > FRAME_TIME * (1 - 0.5 / STEPS_PER_FRAME):
                began.extend([library.TimeManager.getCurrent().getTime(), time.perf_counter(), time.process_time()])

        base.setTimeStepCB(after_step)
        base.runSimulation()
        simulated = library.TimeManager.getCurrent().getTime() - began[0]
        frames = simulated / FRAME_TIME
        timing = 1000 * (time.perf_counter() - began[1]) / frames, 1000 * (time.process_time() - began[2]) / frames
        base.cleanup()
        return timing


def profile(scene: Scene, model_name: str | None) -> dict[str, float]:
    """Processor milliseconds of the parts of a native frame, least of 20, in the middle of the scene, one thread."""
    import torch

    from surfsup.learned import weights_file
    from surfsup.sph.collision import resolve_collisions
    from surfsup.sph.state import Environment

    torch.set_num_threads(1)
    torch.set_grad_enabled(False)
    surface = scene.build_surface()
    start = scene.start(surface)
    model, _ = weights_file.load(weights_file.find(model_name or weights_file.DEFAULT_MODEL))
    environment = Environment.of(scene, surface)
    state = model.start(torch.from_numpy(start.positions), torch.from_numpy(start.particle_velocities), environment)
    for _ in range(scene.frames // 2):
        state, _ = model.step(state, environment)
    positions, velocities, _, last, _ = model.native.take(model, state, environment, handle_collisions=False)
    parts = {
        "whole step": lambda: model.step(state, environment),
        "distances to the solid": lambda: environment.distance_and_normal(positions),
        "guard, with distances": lambda: resolve_collisions(state.positions, positions, velocities, environment, last),
    }
    return {name: min(timed(part, 1)[1] for _ in range(20)) for name, part in parts.items()}


COMPARED = ("solver 1 ms", "solver CFL", "native")
TORCH = "torch"
RUNS: dict[str, Callable[[Scene, str | None], Any]] = {
    "solver 1 ms": lambda scene, _: solver(scene, adaptive=False),
    "solver CFL": lambda scene, _: solver(scene, adaptive=True),
    TORCH: lambda scene, model: ours(scene, model, native=False),
    "native": lambda scene, model: ours(scene, model, native=True),
    "profile": profile,
}


def in_its_own_process(name: str, scene: Scene, threads: int, model: str | None) -> Any:
    """What a run says, in a process with so many threads."""
    with tempfile.TemporaryDirectory() as folder:
        path, result = Path(folder) / "scene.yaml", Path(folder) / "result.json"
        path.write_text(scene.to_yaml())
        command = [sys.executable, __file__, "--run", name, str(path), str(result)]
        command += ["--model", model] if model else []
        environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
        if name.startswith("solver"):
            environment["OMP_WAIT_POLICY"] = "passive"
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{name} failed: {done.stderr.strip()[-500:]}")
        return json.loads(result.read_text())


def main() -> None:
    """Run all, print the table and the ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, nargs="+", default=[3000, 50000])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--frames", type=int, default=200, help="the first 20 are a fall, the easiest for the solver")
    parser.add_argument("--surface", choices=SURFACES, nargs="+", default=["ball"])
    parser.add_argument("--model", default=None)
    parser.add_argument(
        "--torch", action=argparse.BooleanOptionalAction, default=True, help="also without the native step"
    )
    parser.add_argument("--run", nargs=3, metavar=("NAME", "SCENE", "RESULT"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        name, path, result = arguments.run
        Path(result).write_text(json.dumps(RUNS[name](Scene.load(Path(path)), arguments.model)))
        return
    for name, particles in itertools.product(arguments.surface, arguments.particles):
        compare(scene_of(particles, arguments.frames, name), name, arguments)


def compare(scene: Scene, surface: str, arguments: argparse.Namespace) -> None:
    """One scene's table and ratios."""
    count = len(scene.start(scene.build_surface()).positions)
    print(f"{surface}, {count} particles, {arguments.frames} frames; ms a frame, wall clock (cpu)")
    for threads in arguments.threads:
        names = COMPARED + ((TORCH,) if arguments.torch else ())
        told = {name: in_its_own_process(name, scene, threads, arguments.model) for name in names}
        print(f"  {threads} threads: " + ", ".join(f"{name} {t[0]:.2f} ({t[1]:.2f})" for name, t in told.items()))
        fixed, adaptive, native = (told[name][0] for name in COMPARED)
        print(f"    native is {fixed / native:.2f} times as fast as the fixed step, {adaptive / native:.2f} as CFL")
    for name, milliseconds in in_its_own_process("profile", scene, 1, arguments.model).items():
        print(f"    {milliseconds:8.3f} ms  {name}", flush=True)


if __name__ == "__main__":
    main()
