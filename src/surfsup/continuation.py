"""Continues a simulation that was interrupted: its frames from the file, then those that are missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from surfsup.errors import InputError
from surfsup.io.output_folder import OutputFrame
from surfsup.io.trajectory import Trajectory
from surfsup.scene import Scene
from surfsup.scene.pose import Pose
from surfsup.scene.wrench import Wrench
from surfsup.simulation import Simulation


class Continuation:
    """The rest of a simulation.

    The frames of the file are kept as they are; the simulation continues from the last of them. Files hold velocities
    to 1.5e-5 m/s, so the rest differs from that of an uninterrupted run as any two runs of splashing water differ.

    Args:
        file: the trajectory that was interrupted.
        scene: what was simulated; its number of frames may be larger.
        simulator: name of the simulator, which must be that of the file.
        simulate: makes the simulation of a scene.

    Attributes:
        simulation: from the last frame of the file on.
        kept: number of frames in the file.

    Raises:
        InputError: there is no such file, it is of another scene or simulator, or has all frames,
            or it does not hold the velocities of a rigid body.
    """

    def __init__(self, file: Path, scene: Scene, simulator: str, simulate: Callable[[Scene], Simulation]) -> None:
        if not file.is_file():
            raise InputError(f"{file}: there is no interrupted simulation; omit --resume")
        with Trajectory(file) as trajectory:
            self.kept, self._ids = len(trajectory), trajectory.positions.shape[1]
            if not self.kept:
                raise InputError(f"{file}: has no frames yet; omit --resume")
            if trajectory.lifetimes is not None:
                self._ids = int((trajectory.lifetimes[:, 1] > 0).sum())  # that have come so far
            self._last = trajectory.ids(self.kept - 1)
            if described(trajectory.scene) != described(scene):
                raise InputError(f"{file}: is of another scene or other options; give another folder with -o")
            if trajectory.provenance.simulator != simulator:
                raise InputError(
                    f"{file}: was simulated by {trajectory.provenance.simulator}, not by {simulator}; "
                    "give the same --simulator, or another folder with -o"
                )
        if self.kept >= scene.frames:
            raise InputError(
                f"{file}: has all {scene.frames} frames already; give more --frames, or omit --resume to begin anew"
            )
        self._file = file
        rest = scene.with_frames(scene.frames - self.kept + 1)
        self.simulation = simulate(rest.with_changes(restart=file.resolve()))

    @property
    def most_ids(self) -> int:
        """The number of ids in the whole trajectory."""
        return self._ids + self.simulation.most_ids() - len(self._last)

    def frames(self) -> Iterator[OutputFrame]:
        """All frames, those of the file first."""
        with Trajectory(self._file) as trajectory:
            yield from (kept_frame(trajectory, number) for number in range(self.kept))
        for number, frame in enumerate(self.simulation.run()):
            if number:  # the first is the last of the file
                entered = np.arange(self._ids, self._ids + max(0, 1 + int(frame.ids.max(initial=-1)) - len(self._last)))
                ids = np.concatenate([self._last, entered])[frame.ids]
                yield frame.recorded._replace(ids=ids)


def kept_frame(trajectory: Trajectory, number: int) -> OutputFrame:
    """A frame of the file."""
    ids = trajectory.ids(number)
    positions, velocities = (data[number][ids] for data in (trajectory.positions, trajectory.velocities))
    poses = {name: Pose.from_array(rows[number]) for name, rows in trajectory.poses.items()}
    forces = {
        name: Wrench(rows[number], trajectory.torques[name][number])
        for name, rows in trajectory.forces.items()
        if np.isfinite(rows[number]).all()
    }
    liquids = None if trajectory.liquids is None else trajectory.liquids[ids]
    bodies = {name: rows[number] for name, rows in trajectory.bodies.items()}
    return OutputFrame(positions, velocities, poses, ids, forces, liquids, bodies)


def described(scene: Scene) -> str:
    """A scene as text, without its duration and with absolute paths."""
    return scene.with_frames(1).with_paths_relative_to(Path("/nonexistent")).to_yaml()
