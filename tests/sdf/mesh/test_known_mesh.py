"""Meshes from the cache: the same triangles, grids and maps, with the same warnings."""

import warnings
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from surfsup import cache
from surfsup.scene import Container
from surfsup.sdf import MeshSurface, MeshWarning, Transformed, axis_rotation, load_mesh
from surfsup.sph.boundary.boundary_map import MapTables


@pytest.fixture
def open_ball(tmp_path, monkeypatch):
    monkeypatch.setenv("SURFSUP_CACHE", str(tmp_path / "cache"))
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    ball.update_faces(np.arange(len(ball.faces)) > 3)
    ball.export(tmp_path / "ball.obj")
    return tmp_path / "ball.obj"


def loaded(path: Path, up=None) -> tuple[np.ndarray, np.ndarray, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mesh = load_mesh(path, up)
    assert {warning.category for warning in caught} <= {MeshWarning}
    return np.array(mesh.vertices), np.array(mesh.faces), [str(warning.message) for warning in caught]


@pytest.mark.parametrize("up", [None, "y"])
def test_a_known_mesh_has_the_same_triangles_and_warnings(open_ball, up):
    first, again = loaded(open_ball, up), loaded(open_ball, up)
    assert [path.name.partition("-")[0] for path in cache.folder().iterdir()] == ["mesh"]
    np.testing.assert_array_equal(again[0], first[0])
    np.testing.assert_array_equal(again[1], first[1])
    assert again[2] == first[2]
    assert len(first[2]) == 1
    assert first[2][0].startswith(f"{open_ball}: has holes")


def test_a_copy_is_warned_of_under_its_own_name_and_a_changed_file_is_read_again(open_ball):
    vertices, *_ = loaded(open_ball)
    copy = open_ball.with_name("copy.obj")
    copy.write_bytes(open_ball.read_bytes())
    assert loaded(copy)[2][0].startswith(f"{copy}: has holes")
    trimesh.creation.box().export(open_ball)
    assert len(loaded(open_ball)[0]) == 8 != len(vertices)


def test_who_changes_a_mesh_does_not_change_the_next_one(open_ball):
    with pytest.warns(MeshWarning):
        mesh = load_mesh(open_ball)
    before = np.array(mesh.vertices)
    mesh.vertices = np.asarray(mesh.vertices) + 1.0
    np.testing.assert_array_equal(loaded(open_ball)[0], before)


def test_what_differs_has_another_digest():
    ball, box = trimesh.creation.icosphere(subdivisions=1), trimesh.creation.box()
    turned = axis_rotation((0.0, 0.0, 1.0), 30.0)
    surfaces = [
        MeshSurface(ball), MeshSurface(box), MeshSurface(ball, cells=32), MeshSurface(ball, exact=True),
        Transformed(MeshSurface(ball)), Transformed(MeshSurface(ball), scale=2.0),
        Transformed(MeshSurface(ball), translation=(0.0, 0.0, 1.0)), Transformed(MeshSurface(ball), turned),
    ]  # fmt: skip
    assert len({surface.content() for surface in surfaces}) == len(surfaces)
    assert MeshSurface(ball).content() == MeshSurface(ball.copy()).content()


def test_a_surface_that_somebody_else_wrote_is_not_kept(tmp_path, monkeypatch):
    class Inflated(MeshSurface):
        def distance(self, points):
            return super().distance(points) - 0.1

    assert Inflated(trimesh.creation.box()).content() is None
    assert Transformed(Inflated(trimesh.creation.box()), scale=2.0).content() is None


def test_grids_and_maps_of_a_known_mesh_are_the_same(open_ball):
    with pytest.warns(MeshWarning):
        mesh = load_mesh(open_ball)
    points = torch.rand(500, 3) - 0.5
    results = []
    for _ in range(2):
        surface = MeshSurface(mesh)
        of_scene, of_whole = MapTables.of(surface, Container()), MapTables.of_whole(surface, "ball")
        results.append(
            [*map(np.asarray, surface.distance_and_normal(points)), *vars(of_scene).values(), of_whole.nodes]
        )
    for first, again in zip(*results, strict=True):
        np.testing.assert_array_equal(again, first)
