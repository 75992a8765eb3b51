import warnings

import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.scene import Block, Container
from surfsup.scene.from_surface import BLOCK_SIDE, DEFAULT_FIT, GAP, Placement, scene_from_surface


@pytest.fixture
def brick(tmp_path):
    path = tmp_path / "brick.stl"
    trimesh.creation.box(extents=(4.0, 2.0, 1.0)).export(path)
    return path


def build(path, container=None, block=None, **placement):
    return scene_from_surface(path, Placement(**placement), container or Container(), block, frames=10)


def test_a_mesh_of_any_size_is_scaled_onto_the_floor_with_water_above(brick):
    scene, summary = build(brick)
    lower, upper = scene.build_surface().bounds().numpy()
    np.testing.assert_allclose(upper - lower, (DEFAULT_FIT, DEFAULT_FIT / 2, DEFAULT_FIT / 4), rtol=1e-5)
    assert lower[2] == pytest.approx(0, abs=1e-6)
    block = scene.fluid[0].block
    assert block.min[2] == pytest.approx(upper[2] + GAP)
    np.testing.assert_allclose(np.subtract(block.max, block.min), BLOCK_SIDE)
    assert "4 x 2 x 1" in summary
    assert "0.70 x 0.35 x 0.17" in summary
    assert summary.endswith(
        "from (-0.225, -0.225, 0.275) to (0.225, 0.225, 0.725); --block-min and --block-max, together, move it"
    )
    assert scene.initial_particles(scene.build_surface()).excluded == 0


def test_a_mesh_can_be_rotated_moved_and_left_unscaled(tmp_path):
    path = tmp_path / "post.obj"
    trimesh.creation.box(extents=(0.4, 0.2, 0.3)).export(path)
    scene, summary = build(path, fit=None, turn=90.0, at=(0.1, -0.2, 0.15))
    lower, upper = scene.build_surface().bounds().numpy()
    np.testing.assert_allclose((lower, upper), [(0.0, -0.4, 0.0), (0.2, 0.0, 0.3)], atol=1e-6)
    assert "scaled" not in summary


def test_a_given_block_replaces_the_default_one(brick):
    block = Block(min=(-0.1, -0.1, 1.0), max=(0.1, 0.1, 1.2), velocity=(0.0, 0.0, -1.0))
    scene, summary = build(brick, block=block)
    assert "--block-min" not in summary
    assert scene.fluid[0].block == block


def test_a_low_ceiling_makes_the_block_lower(brick):
    scene, _ = build(brick, Container(size=(1.0, 1.0, 0.5)))
    assert scene.fluid[0].block.max[2] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("placement", "container", "message"),
    [
        ({"fit": None}, None, r"is 4 x 2 x 1 m, larger than the container of 1 x 1 x 2 m; omit --no-fit"),
        ({"fit": 1.5}, None, "larger than the container"),
        ({"fit": 0.02}, None, "too small"),
        ({"fit": -1.0}, None, "fit: Input should be greater than 0"),
        ({"at": (0.4, 0.0, 0.0)}, None, "out of the container .* move it with --at"),
        ({"at": (0.0, float("nan"), 0.0)}, None, "at.1: Input should be a finite number"),
        ({"up": "w"}, None, "up"),
        ({"fit": 0.9}, Container(size=(1.0, 1.0, 0.3)), "no room for water"),
    ],
)
def test_a_placement_that_does_not_fit_is_an_error_of_one_line(brick, placement, container, message):
    with pytest.raises(InputError, match=message) as error:
        build(brick, container, **placement)
    assert "\n" not in str(error.value)


def test_a_file_in_millimeters_is_recognized_by_its_size(tmp_path):
    path = tmp_path / "millimeters.stl"
    trimesh.creation.box((200, 200, 150)).export(path)
    with pytest.raises(InputError, match=r"is 200 x 200 x 150 m, larger .*, or give it scale: 0.001 in a scene file"):
        build(path, fit=None)


def test_a_faulty_mesh_causes_one_warning(tmp_path):
    ball = trimesh.creation.icosphere(2, 0.3)
    ball.update_faces(np.arange(len(ball.faces)) % 20 != 0)
    path = tmp_path / "open.stl"
    ball.export(path)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        scene, _ = build(path)
        scene.build_surface()
    assert len(warned) == 1
