"""The neural surfaces that come with the package, by name."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from surfsup.sdf.neural.surface_file import ENDING


def shipped_surfaces() -> dict[str, Path]:
    """Their files by name."""
    folder = Path(str(files("surfsup.surfaces")))
    return {path.stem: path for path in sorted(folder.glob(f"*{ENDING}"))}


def is_shipped(name: Path) -> bool:
    """Whether ``name`` is that of a shipped surface; files of one's own are told from it by their ending."""
    return not name.suffix and str(name) in shipped_surfaces()


def resolve(name: Path) -> Path:
    """The file of the shipped surface called ``name``; any other path as it is."""
    return shipped_surfaces()[str(name)] if is_shipped(name) else name


def seen_from(folder: Path, name: Path) -> Path:
    """The path ``name`` when it starts at ``folder``; the name of a shipped surface as it is."""
    return name if is_shipped(name) else folder / name
