"""Small scenes and trajectories that the tests of this folder share."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Scene
from surfsup.sph.state import ParticleState

FRAMES = 20
SCENE = Scene.from_yaml(
    "surface: {sphere: {radius: 0.3}, at: [0, 0, 0.3]}\n"
    "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\n"
    f"frames: {FRAMES}",
    "test",
)


def write(path: Path, positions: np.ndarray, velocities: np.ndarray, scene: Scene = SCENE) -> Path:
    """Write a trajectory file with these frames."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with TrajectoryWriter(path, scene, Provenance("test"), positions.shape[1]) as writer:
        for frame in zip(positions, velocities, strict=True):
            writer.append(*frame)
    return path


def free_fall(frames: int = FRAMES, scene: Scene = SCENE) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (frames, N, 3) of a fall from rest, integrated as the reference solver does."""
    start = scene.initial_particles(None).positions.astype(np.float64)
    steps = 5 * np.arange(frames)
    drop = -9.81 * 1e-6 * steps * (steps + 1) / 2
    positions = start + drop[:, None, None] * np.array([0, 0, 1])
    velocities = np.zeros_like(positions)
    velocities[..., 2] = (-9.81e-3 * steps)[:, None]
    return positions.astype(np.float32), velocities.astype(np.float32)


class Replay:
    """A simulator that replays given frames."""

    def __init__(self, positions: np.ndarray, velocities: np.ndarray, collided: bool = False) -> None:
        self.frames, self.collided = list(zip(positions, velocities, strict=True)), collided

    def to(self, device: str) -> "Replay":
        """It runs on every device."""
        return self

    def initial_state(self, positions: torch.Tensor, velocities: torch.Tensor, environment: object) -> ParticleState:
        """The given state."""
        return ParticleState(positions, velocities)

    def rollout(
        self, state, environment, frames, handle_collisions=True
    ) -> Iterator[tuple[ParticleState, torch.Tensor]]:
        """The given frames, for any initial state."""
        self.handled_collisions = handle_collisions
        for positions, velocities in self.frames[:frames]:
            state = ParticleState(torch.from_numpy(positions), torch.from_numpy(velocities))
            yield state, torch.full((len(positions),), self.collided)
