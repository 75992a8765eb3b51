import importlib.util

import numpy as np
import pytest

from surfsup.datasets.generation import scene_sampler
from surfsup.datasets.recipes import Recipe
from surfsup.scene import Scene

needs_solver = pytest.mark.skipif(
    importlib.util.find_spec("pysplishsplash") is None, reason="the reference solver is not installed"
)


class Tiny(Recipe):
    """Eight particles in a small container at a random height."""

    name = "tiny"
    gravity = -9.81

    def scene(self, index: int, random: np.random.Generator) -> Scene:
        bottom = random.uniform(0.1, 0.25)
        return Scene.from_yaml(
            f"container: {{size: [0.4, 0.4, 0.4]}}\nframes: 6\ngravity: [0, 0, {self.gravity}]\n"
            f"fluid: [{{block: {{min: [0, 0, {bottom}], max: [0.1, 0.1, {bottom + 0.1}]}}}}]",
            "tiny",
        )


class Heavy(Tiny):
    """Gravity so strong that the water falls through the floor within one or two substeps of the solver."""

    name = "heavy"
    gravity = -1e4


class TinyFine(Tiny):
    """The same with particles, lengths and thus frames of another size, by Froude similarity."""

    name = "tiny-fine"

    def scene(self, index: int, random: np.random.Generator) -> Scene:
        scene, s = super().scene(index, random), 0.25
        (block,) = scene.fluid
        corners = {name: [s * x for x in getattr(block.block, name)] for name in ("min", "max")}
        return Scene.from_yaml(
            f"container: {{size: [{0.4 * s}, {0.4 * s}, {0.4 * s}]}}\nframes: 6\nparticle_radius: {0.015 * s}\n"
            f"fluid: [{{block: {{min: {corners['min']}, max: {corners['max']}}}}}]",
            "tiny-fine",
        )


class Mixed(Recipe):
    """Half of the scenes, at random, fall through the floor; a file lists the discarded ones."""

    name = "mixed"

    def scene(self, index: int, random: np.random.Generator) -> Scene:
        kind = Heavy if random.random() < 0.5 else Tiny
        return kind(self.folder).scene(index, random)

    def discard(self, scene: Scene) -> None:
        with (self.folder / "discarded").open("a") as file:
            print(scene.gravity[2], file=file)


@pytest.fixture
def tiny_recipes(monkeypatch):
    """Recipes that are known in this process and therefore to the threads of its cluster."""
    for recipe in (Tiny, TinyFine, Heavy, Mixed):
        monkeypatch.setitem(scene_sampler.RECIPES, recipe.name, recipe)


@pytest.fixture(scope="session")
def cache(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def own_cache(monkeypatch, cache):
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
