"""How long a user waits: for ``surfsup --help``, for imports, and for the whole command on a mesh.

    python benchmarks/start_up.py
    python benchmarks/start_up.py --mesh dragon.obj     # also 800 frames and the page, first with an empty cache

Processor seconds are printed beside the clock: other work on the machine delays the clock, not them. The first run of
each command reads the files from disk and is printed apart.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from record import write_result

SURFSUP = [sys.executable, "-m", "surfsup.cli"]
COMMANDS = {
    "surfsup --help": [*SURFSUP, "--help"],
    "import surfsup": [sys.executable, "-c", "import surfsup"],
    "import the simulator": [
        sys.executable,
        "-c",
        "import surfsup.simulation, surfsup.scene, surfsup.io.trajectory",
    ],
}


def seconds(command: list[str]) -> tuple[float, float]:
    """Seconds of the clock and of the processors of one process."""
    before, began = processor_seconds(), time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - began, processor_seconds() - before


def processor_seconds() -> float:
    """Of all children so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def time_mesh(mesh: Path, repeats: int) -> None:
    """Print and write the times of the whole command on ``mesh``, with an empty cache and with a full one."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["SURFSUP_CACHE"] = f"{folder}/cache"
        command = [*SURFSUP, "simulate", str(mesh), "-o", f"{folder}/out", "--no-video"]
        first, *known = [seconds(command) for _ in range(repeats + 1)]
    best = min(known)
    for name, (clock, processor) in (("first", first), (f"best of {repeats}", best)):
        print(f"{mesh.name}, 800 frames and the page, {name}: {clock:.2f} s, {processor:.2f} processor seconds")
    write_result(
        "start_up",
        "Whole command: 800 frames of 2,744 particles on a mesh of 50,000 triangles, and the page; mesh known",
        round(best[1], 2),
        "processor seconds",
        None,
        None,
        f"python benchmarks/start_up.py --mesh {mesh.name}",
        {
            "clock_s": round(best[0], 2),
            "first_clock_s": round(first[0], 2),
            "first_processor_s": round(first[1], 2),
            "load": round(os.getloadavg()[0], 1),
        },
    )


def main() -> None:
    """Print the first and the best of five."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mesh", type=Path, help="mesh of the whole command")
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    for name, command in COMMANDS.items():
        first, *rest = [seconds(command) for _ in range(arguments.repeats + 1)]
        best = min(rest)
        print(f"{name:<26} first {first[0]:5.2f} s   best {best[0]:5.2f} s, {best[1]:5.2f} processor seconds")
    if arguments.mesh:
        time_mesh(arguments.mesh, arguments.repeats)


if __name__ == "__main__":
    main()
