"""HDF5 files that have their name only when their head is whole, and space on the disk before they are written."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import h5py

from surfsup.errors import InputError, single_line
from surfsup.io.reserved_space import ReservedSpace


def new_hdf5_file(path: Path, name: Path, size: int, write_head: Callable[[h5py.File], None]) -> h5py.File:
    """A new HDF5 file at ``path``. Whatever ends the program, a file of this name has its head.

    Args:
        path: where it is made.
        name: what errors call it.
        size: bytes that the head may take.
        write_head: writes the head.

    Raises:
        InputError: it cannot be written.
    """
    # Windows renames no file that is open; closing and opening it would move its tables to its end, where a file is cut
    # off first.
    partial = path if os.name == "nt" else path.with_name(f".{path.name}.partial")
    try:
        partial.unlink(missing_ok=True)  # of a run that was killed, or a link to another file
        file = h5py.File(partial, "w")
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else single_line(error)
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise InputError(f"{name}: cannot be written ({reason})") from None
    try:
        ReservedSpace(partial, path).reserve(size)
        write_head(file)
        file.flush()
        partial.replace(path)
    except BaseException as error:  # an interrupt, too, leaves nothing without a head
        with suppress(OSError, RuntimeError):  # the same error once more
            file.close()
        partial.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno:
            raise InputError(f"{name}: cannot be written ({os.strerror(error.errno)})") from None
        raise
    return file
