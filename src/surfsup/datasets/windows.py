"""What training reads: a few frames in a row of one scene, moved by the container's symmetries."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from surfsup.errors import InputError
from surfsup.model.state import State, Surroundings
from surfsup.sdf import Transformed
from surfsup.trajectory import Trajectory

EARLY_FRAMES = 320  # falls, impacts and sloshing happen here
EARLY_SHARE = 0.6  # of the windows that start there


@dataclass(frozen=True)
class Window:
    """Consecutive frames of one scene.

    Attributes:
        state: the fluid at the first of them.
        positions: (K, N, 3) of the K frames that follow, metres.
        velocities: (K, N, 3), m/s.
        around: container, solid and gravity.
    """

    state: State
    positions: Tensor
    velocities: Tensor
    around: Surroundings

    def seen_through(self, matrix: Tensor) -> Window:
        """The same window turned or mirrored by an orthogonal ``matrix`` that maps axes onto axes."""
        around = self.around
        surface = None if around.surface is None else Transformed(around.surface, matrix)
        corners = torch.stack([matrix @ around.lower, matrix @ around.upper])
        return Window(
            State(*(value @ matrix.T for value in vars(self.state).values())),
            self.positions @ matrix.T,
            self.velocities @ matrix.T,
            Surroundings(surface, corners.amin(dim=0), corners.amax(dim=0), matrix @ around.gravity),
        )


class WindowSource(Protocol):
    """Where training draws its windows from."""

    def draw(self, random: np.random.Generator, frames: int) -> Window:
        """A window of ``frames`` frames after its first, of a random scene, place in time and symmetry."""


class Windows:
    """Random windows of a folder of trajectories."""

    def __init__(self, folder: Path) -> None:
        """Look through every trajectory in ``folder``.

        Files are opened anew for every window, which takes 2 ms: a thousand open ones would be more than most
        systems allow, and each would keep its last chunks in memory.

        Raises:
            InputError: there is none, or one cannot be read.
        """
        self.paths = sorted(folder.glob("*.h5"))
        if not self.paths:
            raise InputError(f"{folder}: has no trajectories (*.h5); make some with 'surfsup generate'")
        self._surroundings = []
        for path in self.paths:
            with Trajectory(path) as trajectory:
                scene = trajectory.scene
                self._surroundings.append(Surroundings.of(scene, scene.build_surface()))

    def __len__(self) -> int:
        """The number of trajectories."""
        return len(self.paths)

    def draw(self, random: np.random.Generator, frames: int) -> Window:
        """A window of ``frames`` frames after its first, of a random scene, place in time and symmetry.

        Raises:
            InputError: the scene's trajectory is too short for such a window.
        """
        scene = int(random.integers(len(self)))
        with Trajectory(self.paths[scene]) as trajectory:
            return draw_window(trajectory, str(self.paths[scene]), self._surroundings[scene], random, frames)


class Frames(Protocol):
    """The frames of one scene, in a file or in memory."""

    def __len__(self) -> int:
        """How many there are."""

    def window(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (count, N, 3) float32 from frame ``first`` on."""


def draw_window(frames_of: Frames, name: str, around: Surroundings, random: np.random.Generator, frames: int) -> Window:
    """A window of ``frames`` frames after its first, of a random place in time and symmetry.

    Raises:
        InputError: there are too few frames for that, which the complaint says of ``name``.
    """
    last = len(frames_of) - 1 - frames
    if last < 1:
        raise InputError(f"{name}: has {len(frames_of)} frames, training needs at least {frames + 2}")
    early = random.random() < EARLY_SHARE
    first = int(random.integers(1, min(EARLY_FRAMES, last + 1) if early else last + 1))
    positions, velocities = (torch.from_numpy(values) for values in frames_of.window(first - 1, frames + 2))
    return window(positions, velocities, around).seen_through(symmetry(random))


def window(positions: Tensor, velocities: Tensor, around: Surroundings) -> Window:
    """The window of frames (K + 2, N, 3), of which the first is only the past of the state."""
    state = State(positions[1], velocities[1], positions[1] - positions[0], velocities[1] - velocities[0])
    return Window(state, positions[2:], velocities[2:], around)


def symmetry(random: np.random.Generator) -> Tensor:
    """One of the eight symmetries (3, 3) of a square floor: turns and mirrorings that keep z."""
    matrix = torch.eye(3)
    if random.random() < 0.5:
        matrix = matrix[[1, 0, 2]]
    signs = torch.tensor([*random.choice([-1.0, 1.0], size=2), 1.0], dtype=torch.float32)
    return matrix * signs[:, None]
