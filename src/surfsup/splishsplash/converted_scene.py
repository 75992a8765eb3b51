"""A scene file that was converted from or to SPlisHSPlasH, with the files beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from surfsup.errors import InputError
from surfsup.io.atomic_file import atomic_file


@dataclass(frozen=True)
class ConvertedScene:
    """A converted scene, which is not written yet.

    Attributes:
        text: of the new file; paths in it are relative to it.
        missing: what the scene has and the new one does not, a phrase each.
        out: the new file.
        files: meshes, positions (N, 3) of particles and bytes for the folder beside it, by path.
    """

    text: str
    missing: list[str]
    out: Path
    files: Mapping[Path, trimesh.Trimesh | np.ndarray | bytes]

    def write(self) -> None:
        """Write the scene and its files.

        Raises:
            InputError: nothing can be written there.
        """
        try:
            for path, content in self.files.items():
                path.parent.mkdir(parents=True, exist_ok=True)
                if isinstance(content, trimesh.Trimesh):
                    content.export(path)
                elif isinstance(content, bytes):
                    path.write_bytes(content)
                else:
                    np.save(path, content)
            with atomic_file(self.out) as partial:
                partial.write_text(self.text, encoding="utf-8")
        except OSError as error:
            raise InputError(f"{self.out}: cannot be written ({error.strerror})") from None
