"""Windows for training: consecutive frames of one scene, transformed by a random symmetry of the container."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from surfsup.datasets.units import check_units
from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory, TrajectoryFrames
from surfsup.io.trajectory_path import trajectory_files
from surfsup.learned.message_passing.history import History
from surfsup.scene import FRAME_TIME, Scene
from surfsup.sph.environment import Environment

EARLY_FRAMES = 320  # the frames of the fall, the impact and the sloshing
EARLY_FRACTION = 0.6  # of the windows start within these


@dataclass(frozen=True)
class Window:
    """Consecutive frames of one scene: P history frames, the present frame, and K frames after it.

    Attributes:
        positions: (P + 1 + K, N, 3), meters.
        velocities: (P + 1 + K, N, 3), m/s at the end of each frame.
        history_length: P.
        environment: container, solid and gravity.
        scene: the scene before the symmetry.
        name: of the scene, for error messages.
        at_scene_start: whether the present frame is the scene's first. The history is then the free fall that every
            rollout starts with.
    """

    positions: Tensor
    velocities: Tensor
    history_length: int
    environment: Environment
    scene: Scene
    name: str
    at_scene_start: bool = False

    @property
    def history(self) -> tuple[Tensor, Tensor]:
        """Positions and velocities (P + 1, N, 3) up to the present frame, from which a simulator builds its state."""
        return self.positions[: self.history_length + 1], self.velocities[: self.history_length + 1]

    @property
    def frames_after(self) -> int:
        """The number K of frames after the present one."""
        return len(self.positions) - 1 - self.history_length

    def frame(self, number: int) -> tuple[Tensor, Tensor]:
        """Positions and velocities (N, 3) of a frame; 0 is the present one, 1 the next."""
        return self.positions[self.history_length + number], self.velocities[self.history_length + number]

    def transformed_by(self, matrix: Tensor) -> Window:
        """The window rotated or mirrored by an orthogonal ``matrix`` (3, 3) that maps axes onto axes."""
        return replace(
            self,
            positions=self.positions @ matrix.T,
            velocities=self.velocities @ matrix.T,
            environment=self.environment.transformed_by(matrix),
        )


class WindowSource(Protocol):
    """A source of random training windows.

    Attributes:
        fingerprint: equal for equal data; None if the data changes during training.
    """

    @property
    def fingerprint(self) -> str | None:
        """See the class."""

    def sample(
        self, random: np.random.Generator, history_length: int, frames: int, scene_starts: float = 0.0
    ) -> Window:
        """A window of a random scene, time and symmetry.

        Args:
            random: generator of the random numbers.
            history_length: number of frames before the present one.
            frames: number of frames after the present one.
            scene_starts: fraction of the windows whose present frame is the first of the scene.
        """


class Windows:
    """Random windows of the trajectories in one or more folders, all trajectories with equal probability."""

    def __init__(self, *folders: Path, device: torch.device | str = "cpu") -> None:
        """Open each trajectory in ``folders`` once to read its scene; the windows will be on ``device``.

        Files are opened again for each window, which takes 2 ms. A thousand open files would exceed the limit of most
        systems, and each would keep its last chunks in memory.

        Raises:
            InputError: a folder has no trajectories, or one is unreadable or has another frame time or particle radius.
        """
        self.paths: list[Path] = []
        for folder in folders:
            self.paths += trajectory_files(folder)
        self._scenes: list[Scene] = []
        self._environments: list[Environment] = []
        for path in self.paths:
            with Trajectory(path) as trajectory:
                check_units(path, trajectory)
                scene, poured = trajectory.scene, trajectory.lifetimes is not None
            if scene.moves:
                raise InputError(f"{path}: has solids that move, which no learned simulator knows; leave it out")
            if scene.is_open or poured:
                raise InputError(
                    f"{path}: has water that enters or leaves, which no learned simulator knows; leave it out"
                )
            self._scenes.append(scene)
            self._environments.append(Environment.of(scene, scene.build_surface(), device))

    def __len__(self) -> int:
        """Number of trajectories."""
        return len(self.paths)

    @cached_property
    def fingerprint(self) -> str:
        """A hash of the names and sizes of all files, in order."""
        files = [(path.name, path.stat().st_size) for path in self.paths]
        return hashlib.sha256(repr(files).encode()).hexdigest()

    def sample(
        self, random: np.random.Generator, history_length: int, frames: int, scene_starts: float = 0.0
    ) -> Window:
        """As :meth:`WindowSource.sample`.

        Raises:
            InputError: the trajectory is too short for the window.
        """
        number = int(random.integers(len(self)))
        path, scene, environment = self.paths[number], self._scenes[number], self._environments[number]
        with TrajectoryFrames(path) as trajectory:
            return sample_window(
                trajectory, scene, str(path), environment, random, history_length, frames, scene_starts
            )


class Frames(Protocol):
    """The frames of one scene, in a file or in memory."""

    def __len__(self) -> int:
        """Number of frames."""

    def window(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (count, N, 3) float32 from frame ``first`` on."""


def sample_window(
    trajectory: Frames,
    scene: Scene,
    name: str,
    environment: Environment,
    random: np.random.Generator,
    history_length: int,
    frames: int,
    scene_starts: float = 0.0,
) -> Window:
    """A window of ``trajectory`` at a random time, under a random symmetry.

    Args:
        trajectory: all frames of the scene.
        scene: the scene.
        name: of the scene, for error messages.
        environment: of the scene.
        random: generator of the random numbers.
        history_length: number of frames before the present one.
        frames: number of frames after the present one.
        scene_starts: probability that the present frame is the first of the scene.

    Raises:
        InputError: the trajectory is too short for the window.
    """
    last = len(trajectory) - 1 - frames
    if last < history_length:
        raise InputError(f"{name}: has {len(trajectory)} frames, training needs at least {history_length + 1 + frames}")
    if at_scene_start := scene_starts > 0 and random.random() < scene_starts:
        first, count = 0, 1 + frames
    else:
        early = random.random() < EARLY_FRACTION
        end = max(history_length + 1, min(EARLY_FRAMES, last + 1)) if early else last + 1
        first, count = int(random.integers(history_length, end)) - history_length, history_length + 1 + frames
    device = environment.lower.device
    positions, velocities = (torch.from_numpy(values).to(device) for values in trajectory.window(first, count))
    if at_scene_start:
        positions, velocities = prepend_free_fall(positions, velocities, history_length, environment.gravity)
    window = Window(positions, velocities, history_length, environment, scene, name, at_scene_start)
    return window.transformed_by(random_symmetry(random).to(device))


def prepend_free_fall(positions: Tensor, velocities: Tensor, length: int, gravity: Tensor) -> tuple[Tensor, Tensor]:
    """Prepend ``length`` frames of free fall to a scene's first frames (K, N, 3).

    This is the history of a rollout's first state.
    """
    displacements = History.in_free_fall(positions[0], velocities[0], gravity, length).displacements
    before = positions[0] - displacements.cumsum(dim=1).flip(1).transpose(0, 1)
    frames = torch.arange(length, 0, -1, device=gravity.device)[:, None, None]
    return torch.cat([before, positions]), torch.cat([velocities[0] - FRAME_TIME * frames * gravity, velocities])


def random_symmetry(random: np.random.Generator) -> Tensor:
    """One of the eight symmetries (3, 3) of a square floor: rotations and reflections that keep z."""
    matrix = torch.eye(3)
    if random.random() < 0.5:
        matrix = matrix[[1, 0, 2]]
    signs = torch.tensor([*random.choice([-1.0, 1.0], size=2), 1.0], dtype=torch.float32)
    return matrix * signs[:, None]
