"""Complex-Scenes: our own coral, room and lion, or any folder of meshes."""

import numpy as np
import pytest
import trimesh

from surfsup.datasets.recipes import RECIPES
from surfsup.datasets.recipes.mesh_files import InvalidMeshWarning
from surfsup.errors import InputError
from tests.datasets.recipes.drawn import assert_valid, draw

PARTICLES = (19**3, 21**3)


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """The recipe with our own solids."""
    recipe = RECIPES["complex-scenes"](tmp_path_factory.mktemp("own"))
    recipe.prepare(None, 3)
    return recipe


@pytest.mark.parametrize("index", range(3))
def test_every_scene_of_our_own_is_valid(own, index):
    scene = draw(own, index)
    assert scene.container.size == (2.0, 2.0, 3.0)
    assert_valid(scene, PARTICLES, own.folder)


def test_coral_room_and_lion_alternate(own):
    scenes = [draw(own, index) for index in range(6)]
    kinds = [scene.surface.mesh.file.name if scene.surface.mesh else scene.surface.kind for scene in scenes]
    assert kinds == ["coral.ply", "union", "lion.ply"] * 2
    assert len({scene.to_yaml() for scene in scenes}) == 6


@pytest.mark.parametrize("index", [0, 2])
def test_the_largest_extent_is_slightly_less_than_the_supplements_cube(own, index):
    lower, upper = draw(own, index).build_surface().surface.bounds()
    assert float((upper - lower).max()) == pytest.approx(1.9, abs=1e-5)


def test_the_water_falls_into_the_room(own):
    for attempt in range(20):
        block = draw(own, 1, attempt=attempt).fluid[0].block
        assert (np.abs([*block.min[:2], *block.max[:2]]) < 0.9).all()


def test_only_the_required_meshes_are_written_and_only_once(tmp_path):
    recipe = RECIPES["complex-scenes"](tmp_path)
    recipe.prepare(None, 2)
    coral = tmp_path / "surfaces" / "coral.ply"
    assert list((tmp_path / "surfaces").iterdir()) == [coral]
    before = coral.stat().st_mtime_ns
    recipe.prepare(None, 2)
    assert coral.stat().st_mtime_ns == before


def test_the_meshes_of_a_folder_alternate_and_invalid_ones_are_named(tmp_path):
    source = tmp_path / "meshes"
    source.mkdir()
    trimesh.creation.box((3.0, 1.0, 0.5)).export(source / "b.stl")
    trimesh.creation.icosphere(radius=7).export(source / "a.OBJ".lower())
    (source / "broken.ply").write_text("ply\nnothing\n")
    (source / "notes.txt").write_text("no mesh")
    recipe = RECIPES["complex-scenes"](tmp_path / "data")
    with pytest.warns(InvalidMeshWarning, match=r"broken\.ply.*left out") as warned:
        recipe.prepare(source, 9)
    assert len(warned) == 1
    scenes = [draw(recipe, index) for index in range(4)]
    assert [str(scene.surface.mesh.file) for scene in scenes] == ["surfaces/a.obj", "surfaces/b.stl"] * 2
    for scene in scenes[:2]:
        assert_valid(scene, PARTICLES, tmp_path / "data")


def test_a_folder_without_valid_meshes_is_an_error(tmp_path):
    recipe = RECIPES["complex-scenes"](tmp_path / "data")
    with pytest.raises(InputError, match="it holds no file that ends in obj, stl"):
        recipe.prepare(tmp_path, 3)
    with pytest.raises(InputError, match="nowhere: has no mesh"):
        recipe.prepare(tmp_path / "nowhere", 3)
    (tmp_path / "broken.ply").write_text("ply\nnothing\n")
    with pytest.warns(InvalidMeshWarning), pytest.raises(InputError, match="see the warnings"):
        recipe.prepare(tmp_path, 3)
