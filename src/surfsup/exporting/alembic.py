"""Alembic: one file with all frames, for Houdini, Maya and Cinema 4D. Blender's package bpy writes it.

No kept package on PyPI writes Alembic by itself. Blender reads the frames from a USD file, which is then removed.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from surfsup.errors import InputError
from surfsup.exporting.sequence import check_overwrite
from surfsup.exporting.up_axis import UpAxis
from surfsup.exporting.usd import UsdWriter
from surfsup.viewing.liquid_look import Rgb

SCRIPT = Path(__file__).with_name("alembic_script.py")


def open_writer(folder: Path, fps: float, up: UpAxis, overwrite: bool, colors: Sequence[Rgb]) -> AlembicWriter:
    """A writer of ``water.abc`` in ``folder``."""
    return AlembicWriter(folder, fps, up, overwrite, colors)


class AlembicWriter(UsdWriter):
    """Writes ``/Particles``, ``/Surface`` and ``/Solid`` into one file.

    Its upward axis is y: Blender turns everything. The file appears under its name only when it is complete.
    """

    def __init__(self, folder: Path, fps: float, up: UpAxis, overwrite: bool, colors: Sequence[Rgb]) -> None:
        """Write into ``folder``; see :class:`UsdWriter`."""
        self._fps, self._alembic = float(fps), folder / "water.abc"
        self._unfinished = folder / ".water.partial.abc"
        check_overwrite([self._alembic], overwrite)
        super().__init__(folder / ".water.alembic.usdc", fps, up, True, colors)

    def finish(self) -> list[Path]:
        """Complete the file and return it.

        Raises:
            InputError: Blender could not write it.
        """
        super().finish()
        # In a process of its own: Blender's libraries include another USD.
        command = [sys.executable, str(SCRIPT), str(self._path), str(self._unfinished), repr(self._fps)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode or not self._unfinished.exists():
            reason = (done.stderr or done.stdout).strip().rpartition("\n")[2]
            raise InputError(f"{self._alembic}: Blender could not write it ({reason}); is the disk full?")
        self._unfinished.replace(self._alembic)
        return [self._alembic]

    def close(self) -> None:
        """Remove what is incomplete, and the file for Blender."""
        super().close()
        self._path.unlink(missing_ok=True)
        self._unfinished.unlink(missing_ok=True)
