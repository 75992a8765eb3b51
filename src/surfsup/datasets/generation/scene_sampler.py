"""Draws the scenes of a data set; small enough to send to any worker."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup.datasets.recipes import RECIPES
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.errors import InputError
from surfsup.scene import Scene


@dataclass(frozen=True)
class SceneSampler:
    """Draws the scenes of a data set from its recipe and seed.

    Attributes:
        recipe: name of the recipe.
        seed: determines each scene, together with the scene's index.
        frames: number of frames of every scene; None for the recipe's own.
        folder: of the data set, with the recipe's files.
    """

    recipe: str
    seed: int = 0
    frames: int | None = None
    folder: Path = Path()

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            InputError: the recipe does not exist, the seed is negative, or the number of frames is below 1.
        """
        if self.recipe not in RECIPES:
            raise InputError(f"there is no recipe '{self.recipe}'; known are {', '.join(RECIPES)}")
        if self.seed < 0:
            raise InputError(f"seed is {self.seed}, but must not be negative")
        if self.frames is not None and self.frames < 1:
            raise InputError(f"frames is {self.frames}, but must be at least 1")

    def _recipe(self) -> Recipe:
        return RECIPES[self.recipe](self.folder)

    def prepare(self, source: Path | None, count: int) -> None:
        """Write the files of the first ``count`` scenes into the folder.

        Raises:
            InputError: the recipe takes no source, or cannot use this one.
        """
        self._recipe().prepare(source, count)

    def scene(self, index: int, attempt: int = 0) -> Scene:
        """Draw scene ``index``. ``attempt`` counts the scenes that were drawn for this index before and rejected."""
        entropy = [self.seed, index] if attempt == 0 else [self.seed, index, attempt]
        scene = self._recipe().scene(index, np.random.default_rng(entropy))
        return scene if self.frames is None else scene.with_frames(self.frames)

    def discard(self, scene: Scene) -> None:
        """Remove the files in the folder that only the rejected ``scene`` uses."""
        self._recipe().discard(scene)
