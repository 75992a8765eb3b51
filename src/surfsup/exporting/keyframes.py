"""A sequence of files beside one with the keyframes of the solids that move."""

from __future__ import annotations

from pathlib import Path

from surfsup.exporting.formats import Format
from surfsup.exporting.sequence import SequenceWriter, write_file
from surfsup.exporting.solids import SolidMeshes
from surfsup.exporting.up_axis import UpAxis


class KeyframeWriter(SequenceWriter):
    """Writes ``surface.0001.glb`` and so on, and all solids into ``solid.glb``."""

    def __init__(self, folder: Path, form: Format, overwrite: bool, contents: tuple[str, ...]) -> None:
        """Write into ``folder``; see :class:`SequenceWriter`."""
        super().__init__(folder, form, overwrite, contents)
        self._solids: SolidMeshes | None = None
        self._keys: list[float] = []

    def moving_solids(self, solids: SolidMeshes, time: float, up: UpAxis) -> None:
        """Remember a key."""
        self._solids = solids
        self._keys.append(time)

    def finish(self) -> list[Path]:
        """Write the solids; return the files to open."""
        files = super().finish()
        if self._solids is None:
            return files
        path = self._folder / f"solid{self._format.suffix}"
        write_file(path, self._format.load("animated")(self._solids, self._keys))
        return [*files, path]
