"""The neural surfaces that ship with the package, by name."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from surfsup.errors import InputError

SUFFIX = ".safetensors"


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


def require_surface(name: Path) -> None:
    """Require that ``name`` is that of a shipped surface, or a file.

    Raises:
        InputError: there is neither.
    """
    if is_shipped(name):
        return
    if not name.suffix and not name.exists():
        names = ", ".join(shipped_surfaces())
        raise InputError(f"{name}: there is no such file; give a file or a shipped surface ({names})")
    try:
        name.stat()
    except (OSError, ValueError) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or "its name is no name of a file"
        raise InputError(f"{name}: cannot be read ({reason}); check the path") from None
