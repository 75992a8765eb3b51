"""Prim-Shapes is the data set of section 5.1 of the supplement."""

import numpy as np
import pytest

from surfsup.datasets.recipes import RECIPES, prim_shapes
from surfsup.datasets.recipes.extent import extent
from tests.datasets.recipes.drawn import assert_valid, draw, scenes

SCENES = scenes("prim-shapes", 40)
KINDS = ["sphere", "box", "cylinder", "cone", "torus"]


def test_the_five_shapes_alternate():
    assert [scene.surface.kind for scene in SCENES[:10]] == KINDS * 2


def draw_content(shape, random):
    drawn = shape(random)
    return getattr(drawn, drawn.kind)


def test_sizes_are_in_the_supplements_ranges():
    for seed in range(200):
        random = np.random.default_rng(seed)
        sphere, box, cylinder, cone, torus = (draw_content(shape, random) for shape in prim_shapes.SHAPES)
        assert 0.25 <= sphere.radius <= 0.5
        assert all(0.4 <= side <= 0.7 for side in box.size)
        assert 0.15 <= cylinder.radius <= 0.35
        assert 0.4 <= cylinder.height <= 0.75
        assert 0.4 <= cone.height <= 0.7
        assert 0.2 <= cone.bottom_radius <= 0.4
        assert cone.top_radius == 0.01
        assert 0.2 <= torus.major_radius <= 0.4
        assert torus.major_radius / 4 <= torus.minor_radius <= 3 * torus.major_radius / 4


@pytest.mark.parametrize("index", range(len(SCENES)))
def test_the_shape_is_on_the_floor_between_the_walls_below_the_water(index):
    scene = SCENES[index]
    lower, upper = extent(scene.surface)
    assert lower[2] == pytest.approx(0, abs=1e-9)
    for axis in (0, 1):
        if upper[axis] - lower[axis] <= 1:
            assert lower[axis] >= -0.5 - 1e-9
            assert upper[axis] <= 0.5 + 1e-9
        else:  # wider than the container: in the middle
            assert lower[axis] + upper[axis] == pytest.approx(0, abs=1e-9)
    block = scene.fluid[0].block
    sides = np.subtract(block.max, block.min)
    assert (sides >= 0.4 - 1e-9).all()
    assert (sides <= 0.5 + 1e-9).all()
    gap = block.min[2] - upper[2]
    assert gap >= 0.05 - 1e-9
    assert gap <= 0.65 + 1e-9


@pytest.mark.parametrize(
    "index", [i for i in range(len(SCENES)) if np.ptp(extent(SCENES[i].surface), axis=0).max() < 1]
)
def test_every_scene_is_valid(index):
    assert_valid(SCENES[index], particles=(12**3, 15**3))


def test_places_and_orientations_vary():
    places = np.array([scene.surface.at for scene in SCENES])
    assert (places.std(axis=0)[:2] > 0.05).all()
    axes = np.array([scene.surface.rotate.axis for scene in SCENES])
    assert (axes.std(axis=0) > 0.4).all()


def test_the_same_index_and_seed_give_the_same_scene_and_others_differ():
    recipe = RECIPES["prim-shapes"](".")
    assert draw(recipe, 7) == SCENES[7]
    others = [draw(recipe, 7, seed=4), draw(recipe, 12), draw(recipe, 7, attempt=1), draw(recipe, 7, attempt=2)]
    assert len({scene.to_yaml() for scene in [*others, SCENES[7]]}) == 5
