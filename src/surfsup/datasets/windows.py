"""What training reads: a few frames in a row of one scene, moved by the container's symmetries."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from surfsup.datasets.units import check_units
from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory, TrajectoryFrames
from surfsup.learned.message_passing.history import History
from surfsup.scene import Scene
from surfsup.sph.state import FRAME_TIME, Environment

EARLY_FRAMES = 320  # falls, impacts and sloshing happen here
EARLY_SHARE = 0.6  # of the windows that start there


@dataclass(frozen=True)
class Window:
    """Consecutive frames of one scene: P past ones, the present one, K that follow.

    Attributes:
        positions: (P + 1 + K, N, 3), meters.
        velocities: (P + 1 + K, N, 3), m/s at the ends of the frames.
        past: P.
        environment: container, solid and gravity.
        scene: what the frames are of, before any symmetry.
        name: of the scene, for complaints.
        begins: whether the present frame is the scene's first; the past ones are then the free fall that every rollout
            begins from.
    """

    positions: Tensor
    velocities: Tensor
    past: int
    environment: Environment
    scene: Scene
    name: str
    begins: bool = False

    @property
    def up_to_now(self) -> tuple[Tensor, Tensor]:
        """Positions and velocities (P + 1, N, 3): what a simulator's state is made of."""
        return self.positions[: self.past + 1], self.velocities[: self.past + 1]

    @property
    def following(self) -> int:
        """How many frames follow the present one."""
        return len(self.positions) - 1 - self.past

    def frame(self, number: int) -> tuple[Tensor, Tensor]:
        """Positions and velocities (N, 3) of a frame; 0 is the present one, 1 the first that follows."""
        return self.positions[self.past + number], self.velocities[self.past + number]

    def transformed_by(self, matrix: Tensor) -> Window:
        """The same window turned or mirrored by an orthogonal ``matrix`` that maps axes onto axes."""
        return replace(
            self,
            positions=self.positions @ matrix.T,
            velocities=self.velocities @ matrix.T,
            environment=self.environment.transformed_by(matrix),
        )


class WindowSource(Protocol):
    """Where training draws its windows from."""

    def draw(self, random: np.random.Generator, past: int, frames: int, starts: float = 0.0) -> Window:
        """A window of ``past`` frames, the present one and ``frames`` more, of a random scene, time and symmetry.

        Of all windows the share ``starts`` begins where its scene does.
        """


class Windows:
    """Random windows of one or more folders of trajectories, each trajectory being as likely."""

    def __init__(self, *folders: Path, device: torch.device | str = "cpu") -> None:
        """Look through every trajectory in ``folders``; windows will lie on ``device``.

        Files are opened anew for every window, which takes 2 ms: a thousand open ones would be more than most
        systems allow, and each would keep its last chunks in memory. What they are of is read only once.

        Raises:
            InputError: a folder has none, or one cannot be read or is of another frame time or particle radius.
        """
        self.paths: list[Path] = []
        for folder in folders:
            found = sorted(folder.glob("*.h5"))
            if not found:
                raise InputError(f"{folder}: has no trajectories (*.h5); make some with 'surfsup generate'")
            self.paths += found
        self._scenes, self._surroundings = [], []
        for path in self.paths:
            with Trajectory(path) as trajectory:
                check_units(path, trajectory)
                scene = trajectory.scene
            self._scenes.append(scene)
            self._surroundings.append(Environment.of(scene, scene.build_surface(), device))

    def __len__(self) -> int:
        """The number of trajectories."""
        return len(self.paths)

    def draw(self, random: np.random.Generator, past: int, frames: int, starts: float = 0.0) -> Window:
        """A window of ``past`` frames, the present one and ``frames`` more, of a random scene, time and symmetry.

        Of all windows the share ``starts`` begins where its scene does.

        Raises:
            InputError: the scene's trajectory is too short for such a window.
        """
        number = int(random.integers(len(self)))
        path = self.paths[number]
        with TrajectoryFrames(path) as frames_of:
            return draw_window(
                frames_of, self._scenes[number], str(path), self._surroundings[number], random, past, frames, starts
            )


class Frames(Protocol):
    """The frames of one scene, in a file or in memory."""

    def __len__(self) -> int:
        """How many there are."""

    def window(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (count, N, 3) float32 from frame ``first`` on."""


def draw_window(
    frames_of: Frames,
    scene: Scene,
    name: str,
    environment: Environment,
    random: np.random.Generator,
    past: int,
    frames: int,
    starts: float = 0.0,
) -> Window:
    """A window of ``past`` frames, the present one and ``frames`` more, of a random time and symmetry.

    With the chance ``starts`` it begins where the scene does.

    Raises:
        InputError: there are too few frames for that, which the complaint says of ``name``.
    """
    last = len(frames_of) - 1 - frames
    if last < past:
        raise InputError(f"{name}: has {len(frames_of)} frames, training needs at least {past + 1 + frames}")
    if begins := starts > 0 and random.random() < starts:
        first, count = 0, 1 + frames
    else:
        early = random.random() < EARLY_SHARE
        end = max(past + 1, min(EARLY_FRAMES, last + 1)) if early else last + 1
        first, count = int(random.integers(past, end)) - past, past + 1 + frames
    device = environment.lower.device
    positions, velocities = (torch.from_numpy(values).to(device) for values in frames_of.window(first, count))
    if begins:
        positions, velocities = after_free_fall(positions, velocities, past, environment.gravity)
    whole = Window(positions, velocities, past, environment, scene, name, begins)
    return whole.transformed_by(symmetry(random).to(device))


def after_free_fall(positions: Tensor, velocities: Tensor, past: int, gravity: Tensor) -> tuple[Tensor, Tensor]:
    """A scene's first frames (K, N, 3) with ``past`` more before them, in which its water falls as through nothing.

    That is how a rollout's first state takes its past to have been.
    """
    fallen = History.in_free_fall(positions[0], velocities[0], gravity, past).displacements
    before = positions[0] - fallen.cumsum(dim=1).flip(1).transpose(0, 1)
    frames = torch.arange(past, 0, -1, device=gravity.device)[:, None, None]
    return torch.cat([before, positions]), torch.cat([velocities[0] - FRAME_TIME * frames * gravity, velocities])


def symmetry(random: np.random.Generator) -> Tensor:
    """One of the eight symmetries (3, 3) of a square floor: turns and mirrorings that keep z."""
    matrix = torch.eye(3)
    if random.random() < 0.5:
        matrix = matrix[[1, 0, 2]]
    signs = torch.tensor([*random.choice([-1.0, 1.0], size=2), 1.0], dtype=torch.float32)
    return matrix * signs[:, None]
