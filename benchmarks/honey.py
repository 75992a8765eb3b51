"""Time of a frame of 5 ms of a viscous liquid: surfsup's solver against SPlisHSPlasH with Weiler's viscosity.

    python benchmarks/honey.py [--particles 3000] [--viscosity 0.2] [--frames 120] [--rounds 3]

The scene, the processes and what is timed are those of `benchmarks/against_solver.py`; the liquid does not slip on the
ball. The figures are processor times, one thread, so that a busy machine matters little. The peer solves to the
accuracy that `surfsup reference` sets, and once more to its own default.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from against_solver import Timing, scene_of, time_splishsplash, time_surfsup
from record import write_result
from surfsup.scene import Liquid, Scene
from surfsup.splishsplash import job_files

NAMES = ("surfsup", "SPlisHSPlasH", "SPlisHSPlasH, default accuracy")
DEFAULT_ERROR = 0.01  # of its conjugate gradients


def timing(name: str, scene: Scene) -> Timing:
    """The times of a frame in this process."""
    if name == NAMES[0]:
        return time_surfsup(scene, "dfsph", use_native=True)
    if name == NAMES[2]:
        job_files.VISCOSITY_ERROR = DEFAULT_ERROR
    return time_splishsplash(scene, adaptive=False)


def processor_time(name: str, scene: Scene) -> float:
    """Processor milliseconds of a frame, measured in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path, result = Path(folder) / "scene.yaml", Path(folder) / "result.json"
        path.write_text(scene.to_yaml())
        command = [sys.executable, __file__, "--run", name, str(path), str(result)]
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{name} failed: {done.stderr.strip()[-500:]}")
        return float(json.loads(result.read_text())[1])


def main() -> None:
    """Run all one after the other, print the times, write the medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("--viscosity", type=float, default=0.2)
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--run", nargs=3, metavar=("NAME", "SCENE", "RESULT"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        name, path, result = arguments.run
        Path(result).write_text(json.dumps(timing(name, Scene.load(Path(path)))))
        return
    plain = scene_of(arguments.particles, arguments.frames)
    scene = plain.model_copy(update={"liquid": Liquid(viscosity=arguments.viscosity)})
    count = len(scene.initial_particles(scene.build_surface()).positions)
    times: dict[str, list[float]] = {name: [] for name in NAMES}
    for _ in range(arguments.rounds):
        for name in NAMES:
            times[name].append(processor_time(name, scene))
            print(f"{name}: {times[name][-1]:.2f} ms of processor time a frame", flush=True)
    medians = {name: statistics.median(values) for name, values in times.items()}
    print(f"median: {medians[NAMES[1]] / medians[NAMES[0]]:.2f} times as fast as {NAMES[1]}")
    write_result(
        "honey_speed",
        f"Processor time of a frame of 5 ms, {count:,} particles of {arguments.viscosity:g} m²/s on a ball, one thread",
        round(medians[NAMES[0]], 2),
        "ms",
        "SPlisHSPlasH, Weiler et al. 2018, fixed step of 1 ms",
        round(medians[NAMES[1]], 2),
        f"python benchmarks/honey.py --particles {arguments.particles} --viscosity {arguments.viscosity:g} "
        f"--rounds {arguments.rounds}",
        values={
            "particles": count,
            "frames": arguments.frames,
            "processor_ms": {name: [round(value, 2) for value in values] for name, values in times.items()},
        },
        threads=1,
    )


if __name__ == "__main__":
    main()
