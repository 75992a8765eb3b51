"""The neural surfaces that ship with the package, by name."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from surfsup.sdf.neural.surface_file import SUFFIX


def shipped_surfaces() -> dict[str, Path]:
    """The files of the shipped surfaces by name."""
    folder = Path(str(files("surfsup.sdf.neural") / "shipped"))
    return {path.stem: path for path in sorted(folder.glob(f"*{SUFFIX}"))}


def is_shipped(name: Path) -> bool:
    """Whether ``name`` is that of a shipped surface; files of users have a suffix."""
    return not name.suffix and str(name) in shipped_surfaces()


def surface_path(name: Path) -> Path:
    """The file of the shipped surface ``name``; any other path unchanged."""
    return shipped_surfaces()[str(name)] if is_shipped(name) else name


def path_from(folder: Path, name: Path) -> Path:
    """The path ``name`` relative to ``folder``; the name of a shipped surface unchanged."""
    return name if is_shipped(name) else folder / name
