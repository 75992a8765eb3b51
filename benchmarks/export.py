"""Time and memory of `surfsup export`: 800 frames of 3,000 particles, every frame written.

    python benchmarks/export.py [--formats vtk bgeo ...] [--surfaces ply ...] [--frames 100 800]

Water falls on a ball. Every export is a process of its own, at 200 frames per second, the rate of the trajectory. Its
peak memory is that of the whole process, with all libraries; it should not grow with the number of frames. Times are
given as wall clock, and in brackets as processor time of all threads, which other programs on the machine change little
and which the results state. Surfaces use all cores.

The results are written to `benchmarks/results/export_*.json`.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from record import write_result
from surfsup.scene import Scene
from surfsup.simulation import Simulation

SCENE = (
    "surface: {sphere: {radius: 0.2}, at: [0, 0, 0.2]}\n"
    "fluid: [{block: {min: [-0.23, -0.23, 0.45], max: [0.23, 0.23, 0.96]}}]"
)
FPS = 200


def measure(trajectory: Path, name: str, what: str, out: Path) -> dict[str, Any]:
    """Export in this process: seconds, processor seconds, peak memory in MB, and MB written."""
    from surfsup.exporting.export import export

    wall, processor = time.perf_counter(), time.process_time()
    export(trajectory, name, out, FPS, what)  # type: ignore[arg-type]
    return {
        "seconds": round(time.perf_counter() - wall, 2),
        "processor_seconds": round(time.process_time() - processor, 2),
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
        "written_mb": round(sum(path.stat().st_size for path in out.iterdir()) / 1e6),
    }


def in_a_process(trajectory: Path, name: str, what: str) -> dict[str, Any]:
    """:func:`measure` in a process of its own, whose files are deleted."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, __file__, "--child", str(trajectory), name, what, out]
        return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Measure every format at every number of frames."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--formats", nargs="*", default=["vtk", "vtu", "ply", "bgeo", "npz", "usd"])
    parser.add_argument("--surfaces", nargs="*", default=["ply", "vtk", "obj", "glb", "usd"])
    parser.add_argument("--frames", nargs="+", type=int, default=[100, 800])
    parser.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        trajectory, name, what, out = arguments.child
        print(json.dumps(measure(Path(trajectory), name, what, Path(out))))
        return
    with tempfile.TemporaryDirectory() as folder:
        trajectories = {frames: Path(folder) / f"{frames}.h5" for frames in arguments.frames}
        for frames, path in trajectories.items():
            scene = Scene.from_yaml(f"{SCENE}\nframes: {frames}", "the benchmark's scene", Path())
            simulation = Simulation(scene, device="cpu")
            simulation.record(path)
        particles = len(simulation.particles.positions)
        print(f"{particles} particles; seconds [processor seconds], peak memory")
        for what, names in (("particles", arguments.formats), ("surface", arguments.surfaces)):
            for name in names:
                runs = {frames: in_a_process(path, name, what) for frames, path in trajectories.items()}
                report(what, name, particles, runs)


def report(what: str, name: str, particles: int, runs: dict[int, dict[str, Any]]) -> None:
    """Print and write the results of a format."""
    cells = [
        f"{frames} frames {run['seconds']:6.2f} s [{run['processor_seconds']:.2f}] {run['peak_mb']} MB"
        for frames, run in runs.items()
    ]
    print(f"{what:<10}{name:<5}{'   '.join(cells)}", flush=True)
    frames = max(runs)
    write_result(
        f"export_{what}_{name}",
        f"Processor time of an export of {frames} frames of {particles:,} particles: {what}, {name}",
        runs[frames]["processor_seconds"],
        "s",
        None,
        None,
        "python benchmarks/export.py",
        values={str(frames): run for frames, run in runs.items()} | {"load": os.getloadavg()[0]},
        threads=len(os.sched_getaffinity(0)),
    )


if __name__ == "__main__":
    main()
