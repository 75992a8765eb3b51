"""Which scenes a data set is made of: all that decides it, small enough to be sent to any worker."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup.datasets.recipes import RECIPES
from surfsup.errors import InputError
from surfsup.scene import Scene


@dataclass(frozen=True)
class Drawing:
    """How the scenes of a data set are drawn.

    Attributes:
        recipe: name of the recipe.
        seed: with a scene's number it decides everything that the recipe leaves open.
        frames: of every scene; None leaves it to the recipe.
        folder: of the data set, where the recipe's files lie.
    """

    recipe: str
    seed: int = 0
    frames: int | None = None
    folder: Path = Path()

    def __post_init__(self) -> None:
        """Refuse what cannot be drawn.

        Raises:
            InputError: there is no such recipe, the seed is negative, or there are no frames.
        """
        if self.recipe not in RECIPES:
            raise InputError(f"there is no recipe '{self.recipe}'; known are {', '.join(RECIPES)}")
        if self.seed < 0:
            raise InputError(f"seed is {self.seed}, but must not be negative")
        if self.frames is not None and self.frames < 1:
            raise InputError(f"frames is {self.frames}, but must be at least 1")

    def prepare(self, source: Path | None, count: int) -> None:
        """Put the files that the first ``count`` scenes need into the folder.

        Raises:
            InputError: the recipe takes no source, or cannot use this one.
        """
        RECIPES[self.recipe](self.folder).prepare(source, count)

    def scene(self, index: int, attempt: int = 0) -> Scene:
        """Scene number ``index``; ``attempt`` counts the scenes drawn for it before, which were set aside."""
        entropy = [self.seed, index] if attempt == 0 else [self.seed, index, attempt]
        scene = RECIPES[self.recipe](self.folder).scene(index, np.random.default_rng(entropy))
        return scene if self.frames is None else scene.with_frames(self.frames)

    def set_aside(self, scene: Scene) -> None:
        """Take away what ``scene``, which was drawn and will not be used, alone has put into the folder."""
        RECIPES[self.recipe](self.folder).set_aside(scene)
