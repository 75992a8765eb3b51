"""A scene and trajectories of random frames."""

from pathlib import Path

import numpy as np

from surfsup.io.trajectory_format import VELOCITY_STEP, Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Scene

PARTICLES = 20
SCENE = Scene.from_yaml(
    "surface: {sphere: {radius: 0.3}, at: [0, 0, 0.3]}\nfluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]",
    "test",
)


def frames(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random positions, and velocities that are multiples of VELOCITY_STEP."""
    positions, velocities = np.random.default_rng(seed).normal(size=(2, count, PARTICLES, 3))
    return positions.astype(np.float32), (np.round(velocities / VELOCITY_STEP) * VELOCITY_STEP).astype(np.float32)


def writer(path: Path, particles: int = PARTICLES) -> TrajectoryWriter:
    return TrajectoryWriter(path, SCENE, Provenance("a model", seed=7), particles)


def write(path: Path, count: int) -> tuple[np.ndarray, np.ndarray]:
    positions, velocities = frames(count)
    with writer(path) as out:
        for frame in zip(positions, velocities, strict=True):
            out.append(*frame)
    return positions, velocities
