"""Time of a frame while 100,000 particles are poured from a jug: surfsup's solver, SPlisHSPlasH and other programs.

    python benchmarks/jug.py [--particles 100000] [--until 0.6] [--frames 12] [--rounds 2] [--peers PYTHON]

The jug is tilted until the water runs over its rim into the container; both then continue from that state and that
motion, one after the other in one run. The figures are processor times of a frame of 5 ms at 15 mm (of as many substeps
in both), one thread, without the set-up: for SPlisHSPlasH the difference of a run of few frames and one of more.

PYTHON is the interpreter of an environment with `genesis-world` and `newton`: Genesis' DFSPH and Newton's implicit MPM
then begin with the same particles, in the same box, around a mesh of the jug that stands still where it is
(`peer_pours/` says with which settings). Both are timed on the CPU, on one core, after two frames.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from record import write_result
from surfsup.scene import Scene
from surfsup.scene.solids import build_solids
from surfsup.simulation import Simulation
from surfsup.splishsplash import solver

WATER = 0.0343  # m³ in the jug
SCENE = """
particle_radius: {radius}
container: {{size: [1.8, 1, 1.2]}}
surfaces:
  jug:
    difference:
      - cylinder: {{radius: 0.22, height: 0.4}}
        at: [0, 0, 0.2]
      - cylinder: {{radius: 0.2, height: 1}}
        at: [0, 0, 0.52]
    at: [-0.3, 0, 0.5]
    motion:
      keyframes:
        - {{time: 0}}
        - {{time: 0.6, position: [-0.2, 0, 0.6], rotation: {{axis: [0, 1, 0], degrees: 80}}}}
        - {{time: 1.2, position: [-0.2, 0, 0.6], rotation: {{axis: [0, 1, 0], degrees: 110}}}}
fluid:
  - fill: {{surface: {{cylinder: {{radius: 0.193, height: 0.3}}, at: [-0.3, 0, 0.68]}}}}
"""
FEW = 2  # frames of the run that is the set-up
PEERS = ("genesis", "newton")
JUG_RESOLUTION = 64  # cells of the mesh of the jug along its longest side


def surfsup_frames(scene: Scene, frames: int) -> float:
    """Processor seconds of ``frames`` frames after the first few."""
    simulation = Simulation(scene)
    for _ in range(FEW):
        simulation.step()
    began = time.process_time()
    for _ in range(frames):
        simulation.step()
    return time.process_time() - began


def reference_run(scene: Scene, frames: int) -> float:
    """Processor seconds of a run of SPlisHSPlasH, set-up included, in a process of its own."""
    start = Simulation(scene).particles
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    for _ in solver.simulate(scene.with_frames(frames + 1), None, start):
        pass
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    return end.ru_utime + end.ru_stime - began.ru_utime - began.ru_stime


def reference_frames(scene: Scene, frames: int) -> float:
    """Processor seconds of ``frames`` frames of SPlisHSPlasH, as the difference of two runs."""
    return reference_run(scene, FEW + frames) - reference_run(scene, FEW)


def write_pour(path: Path, scene: Scene, simulation: Simulation) -> None:
    """Write the water and the jug as they are now, for programs that do not read our scenes."""
    (jug,) = build_solids(scene).moving
    mesh = jug.surface.to_mesh(JUG_RESOLUTION)
    np.savez(
        path,
        positions=simulation.frame.positions,
        velocities=simulation.frame.velocities,
        vertices=simulation.frame.poses["jug"].apply(np.asarray(mesh.vertices)).astype(np.float32),
        faces=np.asarray(mesh.faces, np.int32),
        particle_radius=scene.particle_radius,
        container=np.asarray(scene.container.size, np.float32),
        frame_time=scene.frame_time,
    )


def peer_frames(name: str, python: str, pour: Path, frames: int) -> dict:
    """What the script of a peer reports: milliseconds of the processor a frame, and how its water fares."""
    core = min(os.sched_getaffinity(0))
    done = subprocess.run(
        [python, str(Path(__file__).parent / "peer_pours" / f"{name}_pour.py"), str(pour), str(frames)],
        env={**os.environ, "OMP_NUM_THREADS": "1", "CUDA_VISIBLE_DEVICES": ""},
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: os.sched_setaffinity(0, {core}),
    )
    if done.returncode:
        sys.exit(f"{name}: {(done.stderr.strip().splitlines() or ['ended without a word'])[-1]}")
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    """Tilt the jug, time both, print and write the medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, default=100_000)
    parser.add_argument("--until", type=float, default=0.6, help="when the timed frames begin, seconds")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--peers", metavar="PYTHON", help="interpreter of an environment with genesis-world and newton")
    arguments = parser.parse_args()
    radius = round((WATER / arguments.particles) ** (1 / 3) / 2, 6)
    scene = Scene.from_yaml(SCENE.format(radius=radius), "jug")
    with tempfile.TemporaryDirectory() as folder:
        path, simulation = Path(folder) / "poured.h5", Simulation(scene)
        count = len(simulation.particles.positions)
        while simulation.time < arguments.until:
            simulation.step()
        poured = float((simulation.frame.positions[:, 2] < 0.45).mean())
        print(f"{count} particles of {1000 * radius:g} mm, {100 * poured:.1f} % have left the jug", flush=True)
        pour, reports = Path(folder) / "pour.npz", {}
        write_pour(pour, scene, simulation)
        simulation.record(path, 2 * scene.frame_time)
        scene = scene.with_changes(restart=path)
        times: dict[str, list[float]] = {"surfsup": [], "SPlisHSPlasH": []}
        for _ in range(arguments.rounds):
            for name, run in (("surfsup", surfsup_frames), ("SPlisHSPlasH", reference_frames)):
                seconds = run(scene, arguments.frames)
                times[name].append(1000 * seconds / arguments.frames)
                print(f"{name}: {times[name][-1]:.1f} ms of processor time a frame", flush=True)
            for name in PEERS if arguments.peers else ():
                reports[name] = peer_frames(name, arguments.peers, pour, arguments.frames)
                times.setdefault(name, []).append(reports[name]["processor_ms"])
                print(f"{name}: {times[name][-1]:.1f} ms of processor time a frame; {reports[name]}", flush=True)
    medians = {name: statistics.median(values) for name, values in times.items()}
    write_result(
        "jug",
        f"Processor time of a frame, {count:,} particles poured from a jug, one thread",
        round(medians["surfsup"], 1),
        "ms",
        "SPlisHSPlasH, fixed step of 1 ms at 15 mm",
        round(medians["SPlisHSPlasH"], 1),
        f"python benchmarks/jug.py --particles {arguments.particles} --until {arguments.until} "
        f"--frames {arguments.frames} --rounds {arguments.rounds}",
        values={
            "particles": count,
            "radius": radius,
            "poured": round(poured, 3),
            "peers": reports,
            "processor_ms": {name: [round(value, 1) for value in values] for name, values in times.items()},
        },
        threads=1,
    )


if __name__ == "__main__":
    main()
