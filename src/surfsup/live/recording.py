"""A recording of live water as one trajectory, also where water is poured in meanwhile.

A trajectory file is made for a number of particles, so water that is poured in begins a new file. At the end the files
become one, in which the later particles have a first frame of their own.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from surfsup.errors import InputError
from surfsup.io.trajectory import Provenance, Trajectory, TrajectoryWriter
from surfsup.scene import Scene
from surfsup.scene.pose import Pose
from surfsup.simulation import Frame

FRAMES_AT_ONCE = 64  # copied


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
        self._parts: list[Path] = []  # complete, without the present one
        self._begin(frame)

    def _begin(self, frame: Frame) -> None:
        self._stack = ExitStack()
        path = self._part(len(self._parts)) if self._parts else self.path
        self._writer = self._stack.enter_context(self._writer_of(path, len(frame.positions), frame.time))
        self.append(frame)

    def _writer_of(self, path: Path, particles: int, time: float) -> TrajectoryWriter:
        return TrajectoryWriter(path, self._scene, Provenance(self._simulator), particles, start_time=time)

    def _part(self, number: int) -> Path:
        return self.path.with_name(f"{self.path.stem}.part-{number + 1}{self.path.suffix}")

    def append(self, frame: Frame) -> None:
        """Write a frame with the same particles as the one before.

        Raises:
            InputError: the disk is full.
        """
        self._writer.append(frame.positions, frame.velocities, frame.poses)

    def poured(self, frame: Frame) -> None:
        """Continue after particles were added behind the others, without a step.

        Args:
            frame: as the last one, with the new particles.

        Raises:
            InputError: the disk is full.
        """
        self._stack.close()
        part = self._part(len(self._parts))
        if not self._parts:
            self.path.replace(part)
        self._parts.append(part)
        self._begin(frame)

    def finish(self) -> Path:
        """Complete the file; returns its path.

        Raises:
            InputError: the disk is full. The files that would become one are kept.
        """
        self._stack.close()
        if not self._parts:
            return self.path
        parts = [*self._parts, self._part(len(self._parts))]
        try:
            self._join(parts)
        except InputError as error:
            raise InputError(f"{error}; the recording is in {parts[0].name} to {parts[-1].name}") from None
        for part in parts:
            part.unlink()
        return self.path

    def _join(self, parts: list[Path]) -> None:
        with Trajectory(parts[-1]) as last:
            particles = last.positions.shape[1]
        with self._writer_of(self.path, particles, self._start_time) as writer:
            for part in parts:
                with Trajectory(part) as trajectory:
                    # The next file begins with the last frame, and the new particles in it.
                    frames = len(trajectory) - (part != parts[-1])
                    for first in range(0, frames, FRAMES_AT_ONCE):
                        count = min(FRAMES_AT_ONCE, frames - first)
                        window = trajectory.window(first, count)
                        for frame, (positions, velocities) in enumerate(zip(*window, strict=True), start=first):
                            poses = {
                                name: Pose.of(rows[frame][:3], rows[frame][3:])
                                for name, rows in trajectory.poses.items()
                            }
                            writer.append(positions, velocities, poses, trajectory.ids(frame))
