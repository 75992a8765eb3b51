"""Blender: a USD file, a script that opens it, and a .blend file where the package bpy is installed."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from surfsup.exporting.sequence import check_overwrite, write_file
from surfsup.exporting.up_axis import UpAxis
from surfsup.exporting.usd import UsdWriter
from surfsup.viewing.liquid_look import DISPLAY_COLOR, Rgb

SCRIPT, BLEND = "open_in_blender.py", "water.blend"
TEMPLATE_FPS = "FPS = 24.0"
WATER_TINT = (0.6, 0.85, 1.0)
TEMPLATE_TINTS = f'TINTS = {{"Surface": {WATER_TINT}}}'


def open_writer(folder: Path, fps: float, up: UpAxis, overwrite: bool, colors: Sequence[Rgb]) -> BlenderWriter:
    """A writer of ``water.usdc``, ``open_in_blender.py`` and ``water.blend`` in ``folder``."""
    return BlenderWriter(folder, fps, up, overwrite, colors)


class BlenderWriter(UsdWriter):
    """Writes a USD file, and what opens it in Blender."""

    def __init__(self, folder: Path, fps: float, up: UpAxis, overwrite: bool, colors: Sequence[Rgb]) -> None:
        """Write into ``folder``; see :class:`UsdWriter`."""
        self._fps, self._tints = float(fps), tints(colors)
        self._script, self._blend = folder / SCRIPT, folder / BLEND
        check_overwrite([self._script, self._blend], overwrite)
        super().__init__(folder / "water.usdc", fps, up, overwrite, colors)

    def finish(self) -> list[Path]:
        """Complete the files; return the .blend file, or the script if there is no package bpy."""
        super().finish()
        self._blend.unlink(missing_ok=True)
        script = Path(__file__).with_name("blender_script.py").read_text(encoding="utf-8")
        script = script.replace(TEMPLATE_FPS, f"FPS = {self._fps!r}")
        write_file(self._script, script.replace(TEMPLATE_TINTS, f"TINTS = {self._tints!r}").encode())
        if find_spec("bpy") is None:
            return [self._script]
        # In a process of its own: Blender's libraries include another USD.
        done = subprocess.run([sys.executable, self._script], capture_output=True, text=True, check=False)
        if not self._blend.exists():
            reason = (done.stderr or done.stdout).strip().rpartition("\n")[2]
            warnings.warn(f"bpy wrote no {BLEND} ({reason}); open {self._script} in Blender", stacklevel=2)
            return [self._script]
        return [self._blend]


def tints(colors: Sequence[Rgb]) -> dict[str, Rgb]:
    """The tints of clear liquids of these ``colors`` by the names of their surfaces in the file."""
    clear = [WATER_TINT if color == DISPLAY_COLOR else brightened(color) for color in colors]
    return (
        {"Surface": clear[0]} if len(clear) == 1 else {f"Surface_{number}": tint for number, tint in enumerate(clear)}
    )


def brightened(color: Rgb) -> Rgb:
    """A color at full brightness: glass of a dark one would be dark."""
    red, green, blue = (round(part / max(*color, 0.01), 3) for part in color)
    return red, green, blue
