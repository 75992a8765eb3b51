"""Trajectory files that were cut off, as by a full disk or an interrupted copy: the frames that are still readable."""

from __future__ import annotations

import io
import os
from pathlib import Path

import h5py

from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_path import trajectory_path

BEYOND_ALL_FILES = 1 << 50
MAX_SHRINKING = 1e5  # bytes of the values over those of a file: compressed 1,000 times, and cut to a hundredth


class PaddedFile(io.RawIOBase):
    """A file, read-only, followed by zeros without end.

    HDF5 refuses a file that is shorter than its own header says. It opens a padded one, and reports an error where it
    needs something that is missing.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("rb", buffering=0)
        self._position = 0

    def readable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move to a position."""
        start = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: BEYOND_ALL_FILES}[whence]
        self._position = start + offset
        return self._position

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Fill ``buffer`` with the file's bytes, then with zeros."""
        view = memoryview(buffer).cast("B")
        self._file.seek(self._position)
        count = self._file.readinto(view) or 0
        view[count:] = bytes(len(view) - count)
        self._position += len(view)
        return len(view)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()


class CutOffTrajectory(Trajectory):
    """A trajectory whose file was cut off. Reading a frame that is lost raises OSError, RuntimeError or ValueError."""

    def _open(self, path: Path) -> h5py.File:
        return h5py.File(PaddedFile(path), "r")

    def _check_written(self, data: h5py.Dataset) -> None:
        """Frames may be missing, but the rest cannot be a thousandth of a percent.

        Raises:
            ValueError: the shape is absurd.
        """
        size = self.path.stat().st_size
        if data.nbytes > MAX_SHRINKING * size:
            raise ValueError(f"{data.name} should have the shape {data.shape}, in a file of {size} bytes")


def open_readable(path: Path) -> Trajectory:
    """Open a trajectory, also one that was cut off.

    Raises:
        InputError: the file is missing, or nothing of it is readable.
    """
    path = trajectory_path(path)
    try:
        return Trajectory(path)
    except InputError as error:
        if not path.is_file() or not h5py.is_hdf5(path):
            raise
        try:
            return CutOffTrajectory(path)
        except InputError:
            raise error from None
