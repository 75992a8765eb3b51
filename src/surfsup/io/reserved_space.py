"""Disk space that belongs to a file before its library writes there, so that a full disk is noticed in time.

HDF5 cannot recover from a write that fails: closing the file then fails, too, and the file is unreadable. A limit may
be the disk, a quota, or the largest size of a file; only the system knows them all, when the space is taken.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from surfsup.errors import InputError


class ReservedSpace:
    """The space of the file at ``path``, which exists; errors call it ``name`` if that is given."""

    def __init__(self, path: Path, name: Path | None = None) -> None:
        self._path, self._name = path, path if name is None else name

    def reserve(self, size: int, kept: str = "") -> None:
        """Make the file at least ``size`` bytes large on the disk; what is in it stays.

        Args:
            size: of the file.
            kept: end of the message of the error.

        Raises:
            InputError: there is no room; the file is as before.
        """
        if not hasattr(os, "posix_fallocate"):  # macOS
            return
        try:
            file = os.open(self._path, os.O_RDWR)
            try:
                os.posix_fallocate(file, 0, size)
            finally:
                os.close(file)
        except OSError as error:
            raise InputError(
                f"{self._name}: cannot be written: the disk is full, or a limit is reached ({error.strerror}){kept}"
            ) from None

    def release(self, size: int) -> None:
        """Give back all space beyond ``size`` bytes."""
        if self._path.stat().st_size > size:
            os.truncate(self._path, size)


def check_free_space(path: Path, needed: int, kept: str = "") -> None:
    """Require that the disk of the file ``path``, which need not exist, has ``needed`` bytes free.

    Raises:
        InputError: it has not, or there is no such folder; the message ends with ``kept``.
    """
    try:
        free = shutil.disk_usage(path.parent).free
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    if free < needed:
        raise InputError(f"{path}: cannot be written: the disk is full ({free / 1e6:.3g} MB are free){kept}")
