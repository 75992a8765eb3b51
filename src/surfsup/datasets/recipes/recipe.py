"""The one interface of every recipe: which scenes a data set is made of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar

import numpy as np

from surfsup.errors import InputError
from surfsup.scene import Scene


class Recipe(ABC):
    """Scenes drawn one by one, for the data set in ``folder``.

    A data set is complete in itself: files that its scenes need (meshes, heights) lie in its folder and are named
    relative to it, so that it can be moved and so that workers need nothing but the folder.

    Attributes:
        name: what the recipe is called on the command line.
        folder: of the data set.
    """

    name: ClassVar[str]

    def __init__(self, folder: Path) -> None:
        """Take ``folder`` as the data set's; nothing is read or written yet."""
        self.folder = folder

    def prepare(self, source: Path | None, count: int) -> None:
        """Put the files that the first ``count`` scenes refer to into the folder; those there already are kept.

        Args:
            source: what the user gave to make surfaces of; most recipes take none.
            count: how many scenes there will be.

        Raises:
            InputError: this recipe takes no source, or cannot use the one given.
        """
        if source is not None:
            raise InputError(f"recipe '{self.name}' makes its own surfaces; leave out --source {source}")

    @abstractmethod
    def scene(self, index: int, random: np.random.Generator) -> Scene:
        """Scene number ``index``; all that is left open is drawn from ``random``.

        Files that it names are found from the data set's folder.
        """

    def set_aside(self, scene: Scene) -> None:  # noqa: B027  most recipes' scenes leave nothing
        """Take away what ``scene``, which was drawn and will not be used, alone has put into the folder."""
