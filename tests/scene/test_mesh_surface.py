import numpy as np
import pytest
import torch
import trimesh

from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Block, Container, Scene, load_mesh
from surfsup.scene.from_surface import Placement, scene_from_surface
from surfsup.sdf import Surface

BLOCK = Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))


@pytest.fixture
def cup(tmp_path):
    """An off-center brick that lies on its side: its longest extent is y."""
    path = tmp_path / "cup.stl"
    brick = trimesh.creation.box(extents=(2.0, 4.0, 1.0))
    brick.apply_translation((5.0, 6.0, 7.0))
    brick.export(path)
    return path


def assert_same_distance(one: Surface, other: Surface) -> None:
    points = torch.rand(500, 3, generator=torch.Generator().manual_seed(1)) * 2 - 1
    assert torch.equal(one.distance(points), other.distance(points))


def test_a_mesh_is_placed_as_the_command_line_places_it(cup):
    surface = load_mesh(str(cup), fit=0.4, up="y")
    lower, upper = surface.bounds().numpy()
    np.testing.assert_allclose((lower, upper), [(-0.1, -0.05, 0.0), (0.1, 0.05, 0.4)], atol=1e-6)
    scene, _ = scene_from_surface(cup, Placement(fit=0.4, up="y"), Container(), None, 10)
    assert_same_distance(surface, scene.build_surface())


def test_without_fit_a_mesh_keeps_its_coordinates(cup):
    lower, upper = load_mesh(cup).bounds().numpy()
    np.testing.assert_allclose((lower, upper), [(4.0, 4.0, 6.5), (6.0, 8.0, 7.5)], atol=1e-5)


def test_a_scene_of_a_loaded_mesh_can_be_written_and_read(cup, tmp_path):
    surface = load_mesh(cup, fit=0.4, up="y")
    scene = Scene(surface=surface, fluid=[BLOCK])
    assert scene.build_surface() is surface
    assert scene.surface_kind == "mesh"
    read = Scene.from_yaml(scene.to_yaml(), "scene.yaml", tmp_path / "elsewhere")
    assert_same_distance(read.build_surface(), surface)
    assert "file: cup.stl" in scene.with_paths_relative_to(tmp_path).to_yaml()


def test_a_trajectory_of_a_loaded_mesh_holds_its_scene(cup, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    surface = load_mesh("cup.stl", fit=0.4, up="y")
    monkeypatch.chdir(tmp_path.parent)
    with TrajectoryWriter(tmp_path / "a.h5", Scene(surface=surface, fluid=[BLOCK]), Provenance("a test"), 3):
        pass
    with Trajectory(tmp_path / "a.h5") as trajectory:
        assert_same_distance(trajectory.scene.build_surface(), surface)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fit": -1.0}, "fit: Input should be greater than 0"),
        ({"fit": float("nan")}, "fit: Input should be a finite number"),
        ({"up": "x"}, "up: Input should be 'y' or 'z'"),
    ],
)
def test_an_invalid_option_is_an_error_of_one_line(cup, options, message):
    with pytest.raises(InputError, match=message) as error:
        load_mesh(cup, **options)
    assert "\n" not in str(error.value)


def test_a_missing_mesh_is_an_error(tmp_path):
    with pytest.raises(InputError, match=r"absent\.stl: cannot be read"):
        load_mesh(tmp_path / "absent.stl")
