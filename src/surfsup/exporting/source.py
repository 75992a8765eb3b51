"""The frames of a trajectory file, one after the other, up to where the file is readable."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from surfsup.exporting.frames import ParticleFrame
from surfsup.io.trajectory import Trajectory


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
        for number in range(len(trajectory)):
            try:
                positions, velocities = trajectory.window(number, 1)
            except OSError:
                self.cut_off = True
                return
            self.read += 1
            ids = trajectory.ids(number)
            everything = len(ids) == positions.shape[1]
            yield ParticleFrame(
                trajectory.start_time + number * trajectory.frame_time,
                positions[0] if everything else positions[0][ids],
                velocities[0] if everything else velocities[0][ids],
                ids.astype(np.int32),
                trajectory.radius,
            )
