import warnings

import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.scene import Block, Container
from surfsup.scene.mesh_scene import BLOCK_SIDE, FIT, GAP, Placing, pour_on


@pytest.fixture
def brick(tmp_path):
    path = tmp_path / "brick.stl"
    trimesh.creation.box(extents=(4.0, 2.0, 1.0)).export(path)
    return path


def pour(path, container=None, block=None, **placing):
    return pour_on(path, Placing(**placing), container or Container(), block, frames=10)


def test_a_mesh_of_any_size_is_scaled_stands_on_the_floor_and_has_water_above(brick):
    scene, said = pour(brick)
    lower, upper = scene.build_surface().bounds().numpy()
    np.testing.assert_allclose(upper - lower, (FIT, FIT / 2, FIT / 4), rtol=1e-5)
    assert lower[2] == pytest.approx(0, abs=1e-6)
    block = scene.fluid[0].block
    assert block.min[2] == pytest.approx(upper[2] + GAP)
    np.testing.assert_allclose(np.subtract(block.max, block.min), BLOCK_SIDE)
    assert "4 x 2 x 1" in said
    assert "0.70 x 0.35 x 0.17" in said
    assert scene.start(scene.build_surface()).left_out == 0


def test_the_mesh_can_be_turned_moved_and_left_unscaled(tmp_path):
    path = tmp_path / "post.obj"
    trimesh.creation.box(extents=(0.4, 0.2, 0.3)).export(path)
    scene, said = pour(path, fit=None, turn=90.0, at=(0.1, -0.2, 0.15))
    lower, upper = scene.build_surface().bounds().numpy()
    np.testing.assert_allclose((lower, upper), [(0.0, -0.4, 0.0), (0.2, 0.0, 0.3)], atol=1e-6)
    assert "scaled" not in said


def test_a_block_of_the_users_own_is_taken(brick):
    block = Block(min=(-0.1, -0.1, 1.0), max=(0.1, 0.1, 1.2), velocity=(0.0, 0.0, -1.0))
    scene, _ = pour(brick, block=block)
    assert scene.fluid[0].block == block


def test_water_of_a_low_ceiling_is_lower(brick):
    scene, _ = pour(brick, Container(size=(1.0, 1.0, 0.5)))
    assert scene.fluid[0].block.max[2] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("placing", "container", "complaint"),
    [
        ({"fit": None}, None, r"is 4 x 2 x 1 m, larger than the container of 1 x 1 x 2 m; leave out --no-fit"),
        ({"fit": 1.5}, None, "larger than the container"),
        ({"fit": 0.02}, None, "too small"),
        ({"fit": -1.0}, None, "fit: Input should be greater than 0"),
        ({"at": (0.4, 0.0, 0.0)}, None, "out of the container .* move it with --at"),
        ({"at": (0.0, float("nan"), 0.0)}, None, "at.1: Input should be a finite number"),
        ({"up": "w"}, None, "up"),
        ({"fit": 0.9}, Container(size=(1.0, 1.0, 0.3)), "no room for water"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(brick, placing, container, complaint):
    with pytest.raises(InputError, match=complaint) as error:
        pour(brick, container, **placing)
    assert "\n" not in str(error.value)


def test_a_faulty_mesh_is_warned_of_once(tmp_path):
    ball = trimesh.creation.icosphere(2, 0.3)
    ball.update_faces(np.arange(len(ball.faces)) % 20 != 0)
    path = tmp_path / "open.stl"
    ball.export(path)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        scene, _ = pour(path)
        scene.build_surface()
    assert len(told) == 1
