"""Seconds to judge a rollout of 800 frames of about 3,000 particles, reading both files included.

    python benchmarks/judging.py [--frames 800]

Two rollouts of the shipped model, started 1 mm apart, are judged by each other: on a ball, whose distance is a formula,
and on a knot of 16,000 triangles (examples/knot.obj), which are asked one by one. All cores work; the claim is for two.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from surfsup.evaluation.compare import THREADS
from surfsup.evaluation.evaluate import judge_file
from surfsup.evaluation.scores import ALL
from surfsup.io.trajectory import Provenance, TrajectoryWriter
from surfsup.learned import weights_file
from surfsup.scene import Scene, Start
from surfsup.simulation import simulate

KNOT = Path(__file__).parents[1] / "examples" / "knot.obj"
SURFACES = {"ball": "{sphere: {radius: 0.35}, at: [0, 0, 0.35]}", "knot": f"{{mesh: {{file: '{KNOT}', fit: 0.7}}}}"}


def write_rollout(path: Path, scene: Scene, shift: float) -> int:
    """A rollout of the shipped model whose water starts ``shift`` meters aside; returns its number of particles."""
    model, card = weights_file.load(weights_file.find(weights_file.DEFAULT_MODEL))
    surface = scene.build_surface()
    given = scene.start(surface)
    start = Start([block + np.float32([shift, 0, 0]) for block in given.blocks], given.velocities, given.left_out)
    with TrajectoryWriter(path, scene, Provenance(card.name), len(start.positions)) as writer:
        for frame in simulate(model, scene, surface, start, "cpu"):
            writer.append(*frame)
    return len(start.positions)


def main() -> None:
    """Make the rollouts, judge them, and print how long that took."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=800)
    frames = parser.parse_args().frames
    print(f"{'surface':<9}{'particles':>10}{'frames':>8}{'threads':>9}{'seconds':>9}{'Chamfer, m':>12}")
    for name, surface in SURFACES.items():
        text = f"surface: {surface}\nfluid: [{{block: {{min: [-0.24, -0.24, 0.9], max: [0.24, 0.24, 1.35]}}}}]"
        scene = Scene.from_yaml(text, name).with_frames(frames)
        with tempfile.TemporaryDirectory() as folder:
            judged, truth = Path(folder) / "judged.h5", Path(folder) / "truth.h5"
            particles = write_rollout(truth, scene, 0.0)
            write_rollout(judged, scene, 0.001)
            began = time.perf_counter()
            judgment = judge_file(judged, truth)
            seconds = time.perf_counter() - began
        chamfer = judgment.scores[ALL]["chamfer"]
        print(f"{name:<9}{particles:>10}{frames:>8}{THREADS:>9}{seconds:>9.1f}{chamfer:>12.4f}", flush=True)


if __name__ == "__main__":
    main()
