"""The frames of a trajectory file, one after the other, up to where the file is readable."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from isal.igzip_lib import IsalError

from surfsup.exporting.frames import ParticleFrame
from surfsup.io.trajectory import Trajectory

UNREADABLE = (OSError, RuntimeError, ValueError, KeyError, IsalError)


class FrameSource:
    """Reads the frames of a trajectory in order, one at a time.

    Attributes:
        read: number of frames read so far.
        cut_off: whether the last read failed; the frames end there.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self.read = 0
        self.cut_off = False

    def __iter__(self) -> Iterator[ParticleFrame]:
        trajectory = self._trajectory
        ids = np.arange(trajectory.positions.shape[1], dtype=np.int32)
        for number in range(len(trajectory)):
            try:
                positions, velocities = trajectory.window(number, 1)
            except UNREADABLE:  # type: ignore[misc]  # the stub of isal declares an instance
                self.cut_off = True
                return
            self.read += 1
            yield ParticleFrame(
                trajectory.start_time + number * trajectory.frame_time,
                positions[0],
                velocities[0],
                ids,
                trajectory.radius,
            )
