"""The interface of a recipe, which draws the scenes of a data set."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar

import numpy as np

from surfsup.errors import InputError
from surfsup.scene import Scene

Random = np.random.Generator


class Recipe(ABC):
    """Draws the scenes of the data set in ``folder`` one by one.

    A data set is complete in itself: the files of its scenes (meshes, heights) are in its folder, and scenes name them
    relative to it. The folder can therefore be moved, and workers need nothing else.

    Attributes:
        name: of the recipe on the command line.
        folder: of the data set.
    """

    name: ClassVar[str]

    def __init__(self, folder: Path) -> None:
        """Use ``folder`` for the data set; this reads and writes nothing yet."""
        self.folder = folder

    def prepare(self, source: Path | None, count: int) -> None:
        """Write the files of the first ``count`` scenes into the folder; files that are there already are kept.

        Args:
            source: file or folder that the user gave for surfaces; most recipes take none.
            count: number of scenes.

        Raises:
            InputError: the recipe takes no source, or cannot use this one.
        """
        if source is not None:
            raise InputError(f"recipe '{self.name}' makes its own surfaces; leave out --source {source}")

    @abstractmethod
    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index`` with ``random``. Paths in the scene are relative to the data set's folder."""

    def discard(self, scene: Scene) -> None:  # noqa: B027  most scenes have no files of their own
        """Remove the files in the folder that only the rejected ``scene`` uses."""
