"""The folder of a data set: whose it is, who works in it, and how a file gets into it."""

from __future__ import annotations

import fcntl
import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from surfsup.errors import InputError

LOCK = ".lock"
PARTIAL = ".partial"


@contextmanager
def locked(folder: Path) -> Iterator[str]:
    """Make ``folder`` and be the only one that works in it; what a killed run left behind is cleared away.

    The system lets go of the lock when the process ends, however it ends. A folder that is still empty at the end is
    removed again, if it is new.

    Yields:
        A token that stands in the lock file, by which a worker can tell that it sees the same folder.

    Raises:
        InputError: somebody else works in it, or it cannot be written.
    """
    new = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / LOCK).open("a+")
    except OSError as error:
        raise InputError(f"{folder}: cannot be used as the folder of a data set ({error.strerror})") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError(f"{folder}: another run is writing into it; wait for it or stop it") from None
        token = uuid.uuid4().hex
        lock.truncate(0)
        lock.write(token)
        lock.flush()
        clear_leftovers(folder)
        try:
            yield token
        finally:
            clear_leftovers(folder)
            if new and os.listdir(folder) == [LOCK]:
                (folder / LOCK).unlink()
                folder.rmdir()


def token_of(folder: Path) -> str:
    """The token of the run that works in ``folder``, empty where none is seen."""
    try:
        return (folder / LOCK).read_text()
    except OSError:
        return ""


def clear_leftovers(folder: Path) -> None:
    """Remove files that were never finished."""
    for path in folder.glob(f".*{PARTIAL}"):
        path.unlink(missing_ok=True)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A place beside ``path`` to write to; when all went well it becomes ``path`` at once, else it is removed.

    The name is unique: two workers may be at the same file, one of them believed lost.
    """
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}{PARTIAL}")
    try:
        yield partial
        partial.replace(path)
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
