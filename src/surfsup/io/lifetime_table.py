"""When each particle of a trajectory was in the scene, counted while the trajectory is written."""

from __future__ import annotations

import h5py
import numpy as np

from surfsup.io.trajectory_format import LIFETIMES


class LifetimeTable:
    """The first frame of each particle, and the one after its last."""

    def __init__(self, particles: int) -> None:
        """Begin with ``particles`` that have not yet come, which are zero."""
        self._frames = np.zeros((particles, 2), np.int64)

    def add(self, frame: int, ids: np.ndarray | slice) -> None:
        """Note that the particles ``ids`` are in a frame; frames come in order."""
        here = self._frames[ids]
        here[here[:, 1] == 0, 0] = frame
        here[:, 1] = frame + 1
        self._frames[ids] = here

    @property
    def particles(self) -> int:
        """Number of particles that are or were in the scene."""
        return int((self._frames[:, 1] > 0).sum())

    @property
    def entered(self) -> int:
        """Number of particles that came after the first frame."""
        return int((self._frames[:, 0] > 0).sum())

    def left(self, frames: int) -> int:
        """Number of particles that are not in the last one of ``frames``, but were before."""
        return int(((self._frames[:, 1] > 0) & (self._frames[:, 1] < frames)).sum())

    def write(self, file: h5py.File, frames: int) -> None:
        """Write the table to a trajectory of ``frames``, unless all particles were in all of them."""
        if (self._frames == (0, frames)).all():
            return
        if LIFETIMES in file:
            file[LIFETIMES][:] = self._frames
        else:
            file[LIFETIMES] = self._frames
