"""Hills: random terrains from wall to wall, below one or two blocks of water."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter

from surfsup.datasets.recipes import RECIPES
from surfsup.datasets.recipes.hills import terrain
from tests.datasets.recipes.drawn import assert_valid, draw, round_trip

PARTICLES = (12**3, 2 * 16**3)


@pytest.mark.parametrize("index", range(4))
def test_every_scene_is_valid(tmp_path, index):
    assert_valid(draw(RECIPES["hills"](tmp_path), index), PARTICLES, tmp_path)


def test_a_terrain_extends_from_wall_to_wall(tmp_path):
    scene = draw(RECIPES["hills"](tmp_path), 0)
    lower, upper = scene.build_surface().bounds().numpy()
    np.testing.assert_allclose(lower, scene.container.lower, atol=1e-6)
    np.testing.assert_allclose(upper[:2], scene.container.upper[:2], atol=1e-6)
    assert upper[2] == pytest.approx(0.1 + scene.surface.heightfield.height)


def test_a_second_draw_uses_the_same_terrain_file(tmp_path):
    recipe = RECIPES["hills"](tmp_path)
    scene = draw(recipe, 1)
    file = tmp_path / scene.surface.heightfield.file
    before = file.read_bytes()
    assert draw(recipe, 1).to_yaml() == scene.to_yaml()
    assert [path.name for path in file.parent.iterdir()] == [file.name]
    assert file.read_bytes() == before
    assert round_trip(scene, tmp_path).model_dump() == scene.model_dump()


def test_other_scenes_have_other_terrains(tmp_path):
    recipe = RECIPES["hills"](tmp_path)
    files = {draw(recipe, index).surface.heightfield.file for index in range(5)}
    files |= {draw(recipe, 0, attempt=1).surface.heightfield.file, draw(recipe, 0, seed=4).surface.heightfield.file}
    assert len(files) == 7


def test_a_discarded_scene_loses_its_terrain_and_others_keep_theirs(tmp_path):
    recipe = RECIPES["hills"](tmp_path)
    first, second = draw(recipe, 0), draw(recipe, 1)
    for _ in range(2):  # a lost worker's scene may be discarded twice
        recipe.discard(first)
    assert [path.name for path in (tmp_path / "surfaces").iterdir()] == [second.surface.heightfield.file.name]


def test_heights_are_from_zero_to_one_and_long_waves_dominate():
    for seed in range(6):
        heights = terrain((60, 90), np.random.default_rng(seed))
        assert (heights.min(), heights.max()) == (0.0, 1.0)
        assert np.std(heights - uniform_filter(heights, 9)) < 0.5 * np.std(heights)


def test_some_terrains_have_a_level_bottom():
    level = [(terrain((60, 60), np.random.default_rng(seed)) == 0).mean() for seed in range(30)]
    bottoms = [share for share in level if share > 0.01]
    assert 4 <= len(bottoms) <= 17
    assert 0.09 < min(bottoms) < max(bottoms) < 0.51


def test_opposite_sides_differ():
    # Waves whose period is the length of the terrain would make them equal.
    heights = terrain((60, 60), np.random.default_rng(1))
    assert np.abs(heights[0] - heights[-1]).mean() > 3 * np.abs(heights[0] - heights[1]).mean()
