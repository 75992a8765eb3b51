"""The folder of a data set: its lock, its subfolder of surfaces, and files that appear only when complete."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from surfsup.errors import InputError
from surfsup.io.folder_lock import LOCK, take_lock

PARTIAL = ".partial"
SURFACES = "surfaces"  # subfolder with the files of surfaces


@contextmanager
def lock_folder(folder: Path) -> Iterator[str]:
    """Create ``folder``, lock it against other runs, and remove partial files of a killed run.

    The system releases the lock when the process ends for any reason. A new folder that is still empty at the end is
    removed.

    Yields:
        The token in the lock file, by which a worker recognizes the same folder.

    Raises:
        InputError: another run holds the lock, or the folder is not writable.
    """
    new = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be used as the folder of a data set ({error.strerror})") from None
    with take_lock(folder) as lock:
        token = uuid.uuid4().hex
        lock.truncate(0)
        lock.write(token)
        lock.flush()
        remove_partial_files(folder)
        try:
            yield token
        finally:
            remove_partial_files(folder)
            (folder / LOCK).unlink(missing_ok=True)
            if new and not os.listdir(folder):
                folder.rmdir()


def lock_token(folder: Path) -> str:
    """The token in the lock file of ``folder``; empty if there is no lock file."""
    try:
        return (folder / LOCK).read_text()
    except OSError:
        return ""


def remove_partial_files(folder: Path) -> None:
    """Remove incomplete files and folders from a data set's folder."""
    for place in (folder, folder / SURFACES):
        for path in place.glob(f".*{PARTIAL}"):
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A temporary path beside ``path``, renamed to ``path`` at the end, or removed after an error.

    Its name is unique, because two workers may write the same file if one of them was considered lost.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}{PARTIAL}")
    try:
        yield partial
        partial.replace(path)
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
