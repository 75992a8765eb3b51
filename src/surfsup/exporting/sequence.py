"""Exports with a numbered file for each frame."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from surfsup.errors import InputError
from surfsup.exporting.formats import Format
from surfsup.exporting.frames import ParticleFrame
from surfsup.exporting.mesh_frame import MeshFrame
from surfsup.exporting.solids import SolidMeshes
from surfsup.exporting.up_axis import UpAxis, with_up_axis
from surfsup.io.atomic_file import atomic_file

LIQUID, NUMBER = r"-\d+", r"\.\d{4,}"


class SequenceWriter:
    """Writes ``particles.0001.ply``, ``surface.0001.ply`` and so on, and ``solid.ply``.

    Of several liquids each has a surface, ``surface-0.0001.ply``, ``surface-1.0001.ply``.
    Every file appears under its name only when it is complete.
    """

    def __init__(self, folder: Path, form: Format, overwrite: bool, contents: tuple[str, ...]) -> None:
        """Write into ``folder``, which exists.

        Args:
            folder: for the files.
            form: the format of the files.
            overwrite: whether an older export of the same ``contents`` is removed.
            contents: what will be written.

        Raises:
            InputError: there is an older export, or its files cannot be removed.
        """
        self._folder, self._format = folder, form
        self._times: dict[str, list[float]] = {}
        self._to_open: list[Path] = []
        suffixes = "|".join(re.escape(suffix) for suffix in (form.suffix, form.collection) if suffix)
        pattern = re.compile(f"({'|'.join(contents)})({LIQUID})?({NUMBER})?({suffixes})")
        old = sorted(path for path in folder.iterdir() if pattern.fullmatch(path.name))
        remove_older_export(old, overwrite)

    def particles(self, frame: ParticleFrame) -> None:
        """Write the particles of the next frame."""
        self._next("particles", self._format.load("particles"), frame)

    def surface(self, frame: MeshFrame) -> None:
        """Write the water's surface of the next frame, or that of one of several liquids."""
        name = "surface" if frame.liquid is None else f"surface-{frame.liquid}"
        self._next(name, self._format.load("mesh"), frame)

    def solid(self, frame: MeshFrame) -> None:
        """Write the solid."""
        path = self._folder / f"solid{self._format.suffix}"
        write_file(path, self._format.load("mesh")(frame))
        self._to_open.append(path)

    def moving_solids(self, solids: SolidMeshes, time: float, up: UpAxis) -> None:
        """Write the solids of the next frame."""
        self._next("solid", self._format.load("mesh"), with_up_axis(solids.at(time), up))

    def finish(self) -> list[Path]:
        """List the files by their times, if the format has such lists; return the files to open."""
        opened = []
        for name, times in self._times.items():
            first = self._folder / self._name(name, 1)
            if self._format.collection:
                files = ((time, self._name(name, number)) for number, time in enumerate(times, start=1))
                first = self._folder / f"{name}{self._format.collection}"
                write_file(first, self._format.load("collection")(files))
            opened.append(first)
        return [*opened, *self._to_open]

    def close(self) -> None:
        """Nothing is incomplete."""

    def _next(self, name: str, content: Callable[..., bytes], frame: ParticleFrame | MeshFrame) -> None:
        times = self._times.setdefault(name, [])
        write_file(self._folder / self._name(name, len(times) + 1), content(frame))
        times.append(frame.time)

    def _name(self, name: str, number: int) -> str:
        return f"{name}.{number:04d}{self._format.suffix}"


def write_file(path: Path, content: bytes) -> None:
    """Write a file, which appears under its name only when it is complete.

    Raises:
        InputError: it cannot be written.
    """
    try:
        with atomic_file(path) as partial:
            partial.write_bytes(content)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); the files before it are complete") from None


def remove_older_export(files: list[Path], overwrite: bool) -> None:
    """Remove the files of an older export, which a shorter one would leave in part.

    Raises:
        InputError: they may not be overwritten, or cannot be removed.
    """
    check_overwrite(files, overwrite)
    try:
        for path in files:
            path.unlink()
    except OSError as error:
        raise InputError(f"{path}: cannot be overwritten ({error.strerror})") from None


def check_overwrite(files: list[Path], overwrite: bool) -> None:
    """Require that no file exists, unless it may be overwritten.

    Raises:
        InputError: one exists.
    """
    if not overwrite and (existing := next((path for path in files if path.exists()), None)):
        raise InputError(f"{existing}: exists already; give another folder with -o, or --overwrite")
