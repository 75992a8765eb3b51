"""The lock of a folder that a run writes to, so that no other run writes there at the same time."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from surfsup.errors import InputError
from surfsup.io.output_folder import writable_folder

LOCK = ".lock"


@contextmanager
def locked_folder(folder: Path) -> Iterator[Path]:
    """Create ``folder`` and keep other runs out of it until the block ends.

    The system releases the lock when the process ends for any reason. Folders that were new and are empty at the end
    are removed.

    Raises:
        InputError: another run is writing into the folder, or it cannot be written to.
    """
    new = [place for place in (folder, *folder.parents) if not place.exists()]
    writable_folder(folder)
    with take_lock(folder):
        try:
            yield folder
        finally:
            (folder / LOCK).unlink(missing_ok=True)
            with suppress(OSError):  # not empty
                for place in new:
                    place.rmdir()


def take_lock(folder: Path) -> IO[str]:
    """The lock file of ``folder``, open and locked.

    Raises:
        InputError: another run holds the lock, or the file cannot be written. It may be no link: what a lock holds is
            replaced, and in a stranger's folder a link may lead to a file of the user's.
    """
    path = folder / LOCK
    while True:
        try:
            lock = open_plain_file(path)
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            raise InputError(f"{folder}: another run is writing into it; wait for it or stop it") from None
        except OSError as error:
            reason = "its file .lock is a link" if error.errno == errno.ELOOP else error.strerror
            raise InputError(f"{folder}: cannot be locked ({reason}); take another folder") from None
        if is_same_file(lock, path):
            return lock
        lock.close()  # the run that held it has ended and removed it meanwhile


def open_plain_file(path: Path) -> IO[str]:
    """Open ``path`` for reading and writing; it may be new.

    Raises:
        OSError: it is a link, a pipe or a device, or cannot be opened.
    """
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o666)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise FileExistsError(errno.EEXIST, f"its file {path.name} is no plain file")
    return os.fdopen(descriptor, "r+")


def is_same_file(file: IO[str], path: Path) -> bool:
    """Whether an open file is still the one at ``path``."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False
