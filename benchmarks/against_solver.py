"""Milliseconds a frame: the shipped model against SPlisHSPlasH, same scene, same cores, in one run.

    python benchmarks/against_solver.py [--frames 300] [--model NAME]

Set-up is left out on both sides (the solver's boundary maps, our first frame); writing is left out on both sides; the
solver takes its fixed step of 1 ms, five a frame, as in the paper.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from surfsup.datasets.drawing import Drawing

DRAWING, INDEX = Drawing("prim-shapes", seed=3), 0  # a ball, held out of training
SURFSUP = (sys.executable, "-m", "surfsup.cli")


def milliseconds_a_frame(verb: str, scene: Path, threads: int, options: list[str]) -> tuple[float, int]:
    """Run one verb in a process of its own; its milliseconds a frame and its number of particles."""
    with tempfile.TemporaryDirectory() as out:
        command = [*SURFSUP, verb, str(scene), "-o", out, "--no-page", "--no-video", *options]
        environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
        subprocess.run(command, env=environment, check=True, capture_output=True)
        summary = json.loads((Path(out) / "summary.json").read_text())
    return summary["ms_per_frame"], summary["particles"]


def main() -> None:
    """Time both with one and two threads and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--model", default=None)
    arguments = parser.parse_args()
    model = ["--model", arguments.model] if arguments.model else []
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.yaml"
        scene.write_text(DRAWING.scene(INDEX).with_frames(arguments.frames).to_yaml())
        print(f"{'threads':>8}{'particles':>11}{'SPlisHSPlasH':>14}{'surfsup':>9}{'ratio':>7}   (ms a frame of 5 ms)")
        for threads in (1, 2):
            solver, particles = milliseconds_a_frame("reference", scene, threads, ["--threads", str(threads)])
            ours, _ = milliseconds_a_frame("simulate", scene, threads, ["--device", "cpu", *model])
            print(f"{threads:>8}{particles:>11}{solver:>14.1f}{ours:>9.1f}{solver / ours:>7.2f}", flush=True)


if __name__ == "__main__":
    main()
