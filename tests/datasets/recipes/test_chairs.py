"""Procedural chairs, and chairs of a ShapeNetCore folder."""

import numpy as np
import pytest
import trimesh

from surfsup.datasets.procedural.chairs import MIN_THICKNESS, chair
from surfsup.datasets.recipes import RECIPES
from surfsup.datasets.recipes.mesh_files import InvalidMeshWarning
from surfsup.errors import InputError
from surfsup.scene import Shape
from surfsup.sdf import polygonize
from tests.datasets.recipes.drawn import assert_valid, draw, scenes

SCENES = scenes("chairs", 60)


def pieces(shape: Shape) -> list[Shape]:
    return [shape] if shape.union is None else [piece for part in shape.union for piece in pieces(part)]


@pytest.mark.parametrize("index", range(len(SCENES)))
def test_every_scene_is_valid(index):
    assert_valid(SCENES[index], particles=(12**3, 15**3))


@pytest.mark.parametrize("seed", range(25))
def test_a_chair_is_one_solid_that_stands_on_the_floor(seed):
    solid = chair(np.random.default_rng(seed)).surface()
    mesh = polygonize(solid, 80)
    assert mesh.body_count == 1
    assert mesh.bounds[0, 2] == pytest.approx(0, abs=1e-3)
    assert mesh.bounds[1, 2] < 1.15


def test_no_part_is_too_thin():
    for seed in range(300):
        for piece in pieces(chair(np.random.default_rng(seed))):
            sides = piece.box.size if piece.box else (2 * piece.cylinder.radius, piece.cylinder.height)
            assert min(sides) >= MIN_THICKNESS - 1e-9
            assert piece.scale == 1


def test_chairs_differ_in_kind_and_size():
    drawn = [pieces(chair(np.random.default_rng(seed))) for seed in range(300)]
    plans = {tuple(piece.kind for piece in parts) for parts in drawn}
    assert len(plans) > 40
    assert len({str(parts) for parts in drawn}) == 300


def shapenet(folder, models):
    """A folder in ShapeNetCore's layout; y is up, the largest side about one."""
    for name, mesh in models.items():
        path = folder / "03001627" / name / "models" / "model_normalized.obj"
        path.parent.mkdir(parents=True)
        if isinstance(mesh, str):
            path.write_text(mesh)
        else:
            mesh.export(path)
    return folder


def stool(height):
    seat, leg = trimesh.creation.box((0.4, 0.05, 0.4)), trimesh.creation.box((0.1, height, 0.1))
    return trimesh.util.concatenate([seat.apply_translation([0, height / 2, 0]), leg])


MODELS = {"b2": stool(0.9), "a1": stool(0.6), "c3": stool(0.3)}


@pytest.mark.parametrize("below", ["", "03001627", ".."])
def test_shapenets_folder_its_category_and_the_parent_folder_are_accepted(tmp_path, below):
    source = shapenet(tmp_path / "here" / "ShapeNetCore.v2", MODELS) / below
    recipe = RECIPES["chairs"](tmp_path / "data")
    recipe.prepare(source, 2)
    assert [path.name for path in sorted((tmp_path / "data" / "surfaces").iterdir())] == ["a1.obj", "b2.obj"]
    recipe.prepare(source, 5)
    found = [draw(recipe, index) for index in range(5)]
    assert [str(scene.surface.mesh.file) for scene in found] == [
        f"surfaces/{n}.obj" for n in ("a1", "b2", "c3", "a1", "b2")
    ]
    for scene in found:
        assert_valid(scene, particles=(12**3, 15**3), folder=tmp_path / "data")
    tall = found[1].build_surface().bounds()
    assert float(tall[1, 2] - tall[0, 2]) == pytest.approx(0.9, abs=1e-6)  # y was up


def test_an_invalid_chair_is_left_out_with_a_warning(tmp_path):
    source = shapenet(tmp_path / "source", {**MODELS, "a0": "v 0 0 0\n", "b0": "no mesh"})
    recipe = RECIPES["chairs"](tmp_path / "data")
    with pytest.warns(InvalidMeshWarning) as warned:
        recipe.prepare(source, 9)
    assert len(warned) == 2
    assert "a0/models/model_normalized.obj" in str(warned[0].message)
    assert {draw(recipe, index).surface.mesh.file.stem for index in range(9)} == set(MODELS)


def test_a_folder_without_valid_chairs_is_an_error(tmp_path):
    recipe = RECIPES["chairs"](tmp_path / "data")
    with pytest.raises(InputError, match=r"nowhere: holds no chairs; give the folder of ShapeNetCore"):
        recipe.prepare(tmp_path / "nowhere", 3)
    source = shapenet(tmp_path / "source", {"a0": "v 0 0 0\n"})
    with pytest.warns(InvalidMeshWarning), pytest.raises(InputError, match="none of its 1 chairs can be used"):
        recipe.prepare(source, 3)
