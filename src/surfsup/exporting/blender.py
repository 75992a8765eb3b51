"""Blender: a USD file, a script that opens it, and a .blend file where the package bpy is installed."""

from __future__ import annotations

import subprocess
import sys
import warnings
from importlib.util import find_spec
from pathlib import Path

from surfsup.exporting.sequence import check_overwrite, write_file
from surfsup.exporting.up_axis import UpAxis
from surfsup.exporting.usd import UsdWriter

SCRIPT, BLEND = "open_in_blender.py", "water.blend"
TEMPLATE_FPS = "FPS = 24.0"


def open_writer(folder: Path, fps: float, up: UpAxis, overwrite: bool) -> BlenderWriter:
    """A writer of ``water.usdc``, ``open_in_blender.py`` and ``water.blend`` in ``folder``."""
    return BlenderWriter(folder, fps, up, overwrite)


class BlenderWriter(UsdWriter):
    """Writes a USD file, and what opens it in Blender."""

    def __init__(self, folder: Path, fps: float, up: UpAxis, overwrite: bool) -> None:
        """Write into ``folder``; see :class:`UsdWriter`."""
        self._fps = float(fps)
        self._script, self._blend = folder / SCRIPT, folder / BLEND
        check_overwrite([self._script, self._blend], overwrite)
        super().__init__(folder / "water.usdc", fps, up, overwrite)

    def finish(self) -> list[Path]:
        """Complete the files; return the .blend file, or the script if there is no package bpy."""
        super().finish()
        self._blend.unlink(missing_ok=True)
        script = Path(__file__).with_name("blender_script.py").read_text(encoding="utf-8")
        write_file(self._script, script.replace(TEMPLATE_FPS, f"FPS = {self._fps!r}").encode())
        if find_spec("bpy") is None:
            return [self._script]
        # In a process of its own: Blender's libraries include another USD.
        done = subprocess.run([sys.executable, self._script], capture_output=True, text=True, check=False)
        if not self._blend.exists():
            reason = (done.stderr or done.stdout).strip().rpartition("\n")[2]
            warnings.warn(f"bpy wrote no {BLEND} ({reason}); open {self._script} in Blender", stacklevel=2)
            return [self._script]
        return [self._blend]
