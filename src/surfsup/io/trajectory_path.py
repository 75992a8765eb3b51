"""Where trajectories are, without the libraries that read them."""

from __future__ import annotations

from pathlib import Path

from surfsup.errors import InputError


def trajectory_path(path: str | Path) -> Path:
    """The trajectory file of ``path``: itself, or the ``trajectory.h5`` in it if it is a folder with one."""
    inside = Path(path) / "trajectory.h5"
    return inside if inside.is_file() else Path(path)


def existing_trajectory(path: str | Path) -> Path:
    """The trajectory file of ``path``, likewise.

    Raises:
        InputError: there is no such file.
    """
    file = trajectory_path(path)
    if not file.is_file():
        missing = "has no trajectory.h5" if file.is_dir() else "there is no such trajectory file"
        raise InputError(f"{file}: {missing}")
    return file


def trajectory_files(folder: Path) -> list[Path]:
    """The trajectory files of a data set's folder, sorted by name.

    Raises:
        InputError: there is none.
    """
    paths = sorted(folder.glob("*.h5"))
    if not paths:
        missing = "has no trajectories (*.h5)" if folder.exists() else "there is no such folder"
        raise InputError(f"{folder}: {missing}; make one, as in: surfsup generate prim-shapes -n 5 -o {folder}")
    return paths
