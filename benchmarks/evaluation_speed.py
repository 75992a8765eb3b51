"""Seconds to evaluate a rollout of 800 frames of about 3,000 particles, reading both files included.

    python benchmarks/evaluation_speed.py [--frames 800]

Two rollouts of the default simulator, started 1 mm apart, are compared with each other: on a ball, whose distance is a
formula, and on a knot of 16,000 triangles (examples/knot.obj), where the distance to the nearest triangle is computed.
All cores work; the goal is stated for two.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from surfsup.evaluation.compare import THREADS
from surfsup.evaluation.evaluate import evaluate_trajectory
from surfsup.evaluation.scores import ALL
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import InitialParticles, Scene
from surfsup.simulation import Simulation

KNOT = Path(__file__).parents[1] / "examples" / "knot.obj"
SURFACES = {"ball": "{sphere: {radius: 0.35}, at: [0, 0, 0.35]}", "knot": f"{{mesh: {{file: '{KNOT}', fit: 0.7}}}}"}


def write_rollout(path: Path, scene: Scene, offset: float) -> int:
    """Write a rollout whose water starts ``offset`` meters aside; returns its number of particles."""
    given = scene.initial_particles(scene.build_surface())
    start = InitialParticles(
        [block + np.float32([offset, 0, 0]) for block in given.block_positions], given.block_velocities, given.excluded
    )
    with TrajectoryWriter(path, scene, Provenance(DEFAULT_SIMULATOR), len(start.positions)) as writer:
        for frame in Simulation(scene, device="cpu", particles=start).run():
            writer.append(frame.positions, frame.velocities)
    return len(start.positions)


def main() -> None:
    """Make the rollouts, evaluate them, and print how long that took."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=800)
    frames = parser.parse_args().frames
    print(f"{'surface':<9}{'particles':>10}{'frames':>8}{'threads':>9}{'seconds':>9}{'Chamfer, m':>12}")
    for name, surface in SURFACES.items():
        text = f"surface: {surface}\nfluid: [{{block: {{min: [-0.24, -0.24, 0.9], max: [0.24, 0.24, 1.35]}}}}]"
        scene = Scene.from_yaml(text, name).with_frames(frames)
        with tempfile.TemporaryDirectory() as folder:
            rollout, reference = Path(folder) / "rollout.h5", Path(folder) / "reference.h5"
            particles = write_rollout(reference, scene, 0.0)
            write_rollout(rollout, scene, 0.001)
            began = time.perf_counter()
            evaluation = evaluate_trajectory(rollout, reference)
            seconds = time.perf_counter() - began
        chamfer = evaluation.scores[ALL]["chamfer"]
        print(f"{name:<9}{particles:>10}{frames:>8}{THREADS:>9}{seconds:>9.1f}{chamfer:>12.4f}", flush=True)


if __name__ == "__main__":
    main()
