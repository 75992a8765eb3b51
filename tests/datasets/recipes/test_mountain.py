"""Mountain: any terrain as a solid from wall to wall, below three blocks of water."""

import numpy as np
import pytest
from PIL import Image

from surfsup.datasets.recipes import RECIPES
from surfsup.datasets.recipes.mountain import MAX_SAMPLES, downsample
from surfsup.errors import InputError
from tests.datasets.recipes.drawn import assert_valid, draw

PARTICLES = (3 * 12**3, 3 * 15**3)


@pytest.fixture
def hills(tmp_path):
    """A terrain of 40 x 30 samples as a PNG of 16 bits."""
    x, y = np.meshgrid(np.linspace(0, 9, 30), np.linspace(0, 12, 40))
    heights = 1000 * (np.sin(x) + np.cos(y) + 2)
    Image.fromarray(heights.astype(np.uint16)).save(tmp_path / "hills.png")
    return tmp_path / "hills.png"


@pytest.mark.parametrize("index", range(3))
def test_every_scene_is_valid(tmp_path, hills, index):
    recipe = RECIPES["mountain"](tmp_path / "data")
    recipe.prepare(hills, 3)
    scene = draw(recipe, index)
    assert scene.container.size == (2.25, 3.0, 2.0)
    assert len(scene.fluid) == 3
    assert_valid(scene, PARTICLES, tmp_path / "data")


def test_the_terrain_extends_from_wall_to_wall(tmp_path, hills):
    recipe = RECIPES["mountain"](tmp_path / "data")
    recipe.prepare(hills, 1)
    bounds = draw(recipe, 0).build_surface().bounds().numpy()
    np.testing.assert_allclose(bounds, [[-1.125, -1.5, 0], [1.125, 1.5, 0.8]], atol=1e-6)


def test_the_default_terrain_is_matplotlibs_elevation_data(tmp_path):
    recipe = RECIPES["mountain"](tmp_path)
    recipe.prepare(None, 1)
    scenes = [draw(recipe, index) for index in range(10)]
    assert len({scene.to_yaml() for scene in scenes}) == 10
    assert scenes[0].container.size == (3.0, 3.0, 2.0)
    heights = np.load(tmp_path / "surfaces" / "mountain.npy")
    assert heights.shape == (150, 150)
    assert 250 < heights.min() < heights.max() < 1100  # meters above the sea
    assert_valid(scenes[0], PARTICLES, tmp_path)


def test_an_existing_terrain_is_kept(tmp_path, hills):
    recipe = RECIPES["mountain"](tmp_path / "data")
    recipe.prepare(hills, 1)
    before = draw(recipe, 0)
    recipe.prepare(None, 5)
    assert draw(recipe, 0) == before


def test_fine_detail_is_averaged():
    heights = np.add.outer(np.zeros(4 * MAX_SAMPLES + 3), np.arange(2.0 * MAX_SAMPLES))
    small = downsample(heights)
    assert max(small.shape) <= MAX_SAMPLES
    np.testing.assert_allclose(np.diff(small, axis=1), heights.shape[0] // small.shape[0])
    np.testing.assert_array_equal(downsample(small), small)


def test_a_strip_or_an_invalid_terrain_is_an_error(tmp_path):
    np.save(tmp_path / "strip.npy", np.zeros((10, 100)))
    with pytest.raises(InputError, match=r"strip.npy: is a strip of 10 x 100 samples; cut it"):
        RECIPES["mountain"](tmp_path / "data").prepare(tmp_path / "strip.npy", 1)
    with pytest.raises(InputError, match="holes"):
        np.save(tmp_path / "holes.npy", np.full((9, 9), np.nan))
        RECIPES["mountain"](tmp_path / "data").prepare(tmp_path / "holes.npy", 1)
    assert not (tmp_path / "data").exists()


def test_without_matplotlib_the_error_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(InputError, match=r"pip install 'surfsup\[terrain\]'"):
        RECIPES["mountain"](tmp_path).prepare(None, 1)
