"""The locks of the folders that a verb writes to, held until the program ends."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

held_locks = ExitStack()


def hold_lock(folder: Path) -> None:
    """Create ``folder`` and keep other runs out of it until the verb has ended.

    Raises:
        InputError: another run is writing into it, or it is not writable.
    """
    from surfsup.io.folder_lock import locked_folder

    held_locks.enter_context(locked_folder(folder))
