from pathlib import Path

import numpy as np
import pytest

from surfsup.exporting.frames import ParticleFrame
from surfsup.exporting.mesh_frame import MeshFrame
from surfsup.scene import Scene
from surfsup.simulation import Simulation

SCENE = Scene.from_yaml(
    "surface: {sphere: {radius: 0.2}, at: [0, 0, 0.2]}\n"
    "fluid: [{block: {min: [-0.1, -0.1, 0.43], max: [0.1, 0.1, 0.63]}}]\n"
    "frames: 61",
    "test",
    Path(),
)


@pytest.fixture(scope="session")
def trajectory(tmp_path_factory) -> Path:
    """Water that falls on a ball: 61 frames, 0.3 s."""
    path = tmp_path_factory.mktemp("trajectory") / "trajectory.h5"
    Simulation(SCENE, device="cpu").record(path)
    return path


def cloud(count: int, seed: int = 0, time: float = 0.25) -> ParticleFrame:
    """Random particles, whose ids have gaps."""
    random = np.random.default_rng(seed)
    positions, velocities = random.normal(0, 0.1, (2, count, 3)).astype(np.float32)
    ids = np.sort(random.choice(10 * count + 1, count, replace=False)).astype(np.int32)
    return ParticleFrame(time, positions, velocities, ids, 0.015)


def tetrahedron(time: float = 0.25) -> MeshFrame:
    """Four triangles around (1, 2, 3)."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)
    outwards = corners - corners.mean(axis=0)
    normals = outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
    velocities = np.array([[1, 0, 0], [0, 2, 0], [0, 0, 3], [4, 5, 6]], np.float32)
    return MeshFrame(time, corners + np.float32([1, 2, 3]), triangles, normals, velocities)
