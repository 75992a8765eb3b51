"""The frames of a trajectory file, one after the other, up to where the file is readable."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from surfsup.errors import InputError
from surfsup.exporting.frames import ParticleFrame
from surfsup.io.trajectory import Trajectory

LARGEST = 1e30  # of positions and velocities, in meters and m/s


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
            ids = trajectory.ids(number)
            everything = len(ids) == positions.shape[1]
            place, velocity = (part[0] if everything else part[0][ids] for part in (positions, velocities))
            if not all((np.abs(part) < LARGEST).all() for part in (place, velocity)):
                raise InputError(f"{trajectory.path}: frame {number} has values that are no finite numbers of float32")
            self.read += 1
            yield ParticleFrame(
                trajectory.start_time + number * trajectory.frame_time,
                place,
                velocity,
                ids.astype(np.int32),
                trajectory.radius,
                None if trajectory.liquids is None else trajectory.liquids[ids],
            )
