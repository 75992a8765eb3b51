"""Scenes as a data set draws them, and checks that hold for the scenes of every recipe."""

from pathlib import Path

import numpy as np
import torch

from surfsup.datasets.recipes import RECIPES, Recipe
from surfsup.scene import Scene


def draw(recipe: Recipe, index: int, seed: int = 3, attempt: int = 0) -> Scene:
    return recipe.scene(index, np.random.default_rng([seed, index, attempt]))


def scenes(name: str, count: int, folder: Path = Path()) -> list[Scene]:
    """The first scenes of a recipe that needs no files."""
    recipe = RECIPES[name](folder)
    recipe.prepare(None, count)
    return [draw(recipe, index) for index in range(count)]


def round_trip(scene: Scene, folder: Path = Path()) -> Scene:
    return Scene.from_yaml(scene.to_yaml(), "scene.yaml", folder)


def assert_valid(scene: Scene, particles: tuple[int, int], folder: Path = Path()) -> None:
    """Check that a file restores the scene, its solid is in the container, and the water is clear of both."""
    read = round_trip(scene, folder)
    assert read.model_dump() == scene.model_dump()
    surface = read.build_surface()
    start = read.initial_particles(surface)  # raises if a block is not in the container
    assert start.excluded == 0
    assert particles[0] <= len(start.positions) <= particles[1]
    with torch.no_grad():
        assert float(surface.distance(torch.from_numpy(start.positions)).min()) > 0.03
        assert float(surface.distance(points_on_walls(scene)).min()) > 0


def points_on_walls(scene: Scene, beyond: float = 1e-3, count: int = 40) -> torch.Tensor:
    """A lattice (N, 3) on floor, walls and ceiling, ``beyond`` meters outside."""
    lower, upper = np.array(scene.container.lower), np.array(scene.container.upper)
    share = np.stack(np.meshgrid(*[np.linspace(0, 1, count)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    share = share[((share == 0) | (share == 1)).any(axis=1)]
    return torch.as_tensor(lower - beyond + share * (upper - lower + 2 * beyond), dtype=torch.float32)
