"""A recording of live water as one trajectory, also where water is poured in or flows from a tap meanwhile.

A trajectory file is made for a number of particles, so further water begins a new file, with room for more where a tap
gives it. At the end the files become one, in which the later particles have a first frame of their own.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Scene
from surfsup.scene.pose import Pose
from surfsup.simulation_state import Frame

FRAMES_AT_ONCE = 64  # copied
ROOM = 1000  # particles of a tap in a file, at least
GROWTH = 0.5  # of the particles so far, for those of a tap


class Recording:
    """Writes frames to a new trajectory file.

    Args:
        path: of the file.
        scene: that it describes.
        simulator: its name.
        frame: the first one.

    Attributes:
        path: of the file.

    Raises:
        InputError: the file cannot be written.
    """

    def __init__(self, path: Path, scene: Scene, simulator: str, frame: Frame) -> None:
        self.path, self._scene, self._simulator = path, scene, simulator
        self._start_time = frame.time
        self._parts: list[tuple[Path, int]] = []  # complete, without the present one; and the frames to take from each
        self._particles = 0
        self._begin(frame, room=0 if len(frame.ids) else ROOM)

    def _begin(self, frame: Frame, room: int) -> None:
        self._stack, self._room = ExitStack(), particles_of(frame) + room
        path = self._part(len(self._parts)) if self._parts else self.path
        self._writer = self._stack.enter_context(self._writer_of(path, self._room, frame.time))
        self._write(frame)

    def _write(self, frame: Frame) -> None:
        self._writer.append(frame.positions, frame.velocities, frame.poses, frame.ids, liquids=frame.liquids)
        self._particles = max(self._particles, particles_of(frame))

    def _writer_of(self, path: Path, particles: int, time: float) -> TrajectoryWriter:
        return TrajectoryWriter(path, self._scene, Provenance(self._simulator), particles, start_time=time)

    def _part(self, number: int) -> Path:
        return self.path.with_name(f"{self.path.stem}.part-{number + 1}{self.path.suffix}")

    def append(self, frame: Frame) -> None:
        """Write the next frame, in which particles may have entered through a tap.

        Raises:
            InputError: the disk is full.
        """
        if particles_of(frame) <= self._room:
            self._write(frame)
            return
        self._complete_part(self._writer.frames)
        self._begin(frame, max(ROOM, round(GROWTH * particles_of(frame))))

    def poured(self, frame: Frame) -> None:
        """Continue after particles were added behind the others, without a step.

        Args:
            frame: as the last one, with the new particles.

        Raises:
            InputError: the disk is full.
        """
        self._complete_part(self._writer.frames - 1)  # the next file begins with this frame, and the new particles
        self._begin(frame, room=0)

    def _complete_part(self, frames: int) -> None:
        """End the present file, of which so many frames will be taken."""
        self._stack.close()
        part = self._part(len(self._parts))
        if not self._parts:
            self.path.replace(part)
        self._parts.append((part, frames))

    def finish(self) -> Path:
        """Complete the file; returns its path.

        Raises:
            InputError: the disk is full. The files that would become one are kept.
        """
        if not self._parts and self._particles == self._room:
            self._stack.close()
            return self.path
        self._complete_part(self._writer.frames)
        try:
            self._join()
        except InputError as error:
            first, last = (self._parts[number][0].name for number in (0, -1))
            raise InputError(f"{error}; the recording is in {first} to {last}") from None
        for part, _ in self._parts:
            part.unlink()
        return self.path

    def _join(self) -> None:
        with self._writer_of(self.path, max(1, self._particles), self._start_time) as writer:
            for part, frames in self._parts:
                with Trajectory(part) as trajectory:
                    for first in range(0, frames, FRAMES_AT_ONCE):
                        count = min(FRAMES_AT_ONCE, frames - first)
                        window = trajectory.window(first, count)
                        for frame, (positions, velocities) in enumerate(zip(*window, strict=True), start=first):
                            poses = {
                                name: Pose.of(rows[frame][:3], rows[frame][3:])
                                for name, rows in trajectory.poses.items()
                            }
                            ids = trajectory.ids(frame)
                            liquids = None if trajectory.liquids is None else trajectory.liquids[ids]
                            writer.append(positions[ids], velocities[ids], poses, ids, liquids=liquids)


def particles_of(frame: Frame) -> int:
    """The number of particles that a file needs for a frame."""
    return int(frame.ids[-1]) + 1 if len(frame.ids) else 0
