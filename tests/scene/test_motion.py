import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import InputError
from surfsup.scene import Scene, quaternion
from surfsup.scene.motion import Keyframe, Motion, Spin, read_poses
from surfsup.scene.pose import Pose, between
from surfsup.scene.pose_curve import PoseCurve
from surfsup.scene.solids import build_solids

REST = Pose.of((1.0, 2.0, 3.0))
HEADER = "time,x,y,z,qw,qx,qy,qz\n"
WATER = "fluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]\n"
rotations = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1)
vectors = st.tuples(*[st.floats(-2, 2)] * 3)


def same_rotation(one, other, tolerance=1e-9):
    return abs(one @ other) > 1 - tolerance


@given(one=rotations, other=rotations, vector=vectors)
def test_the_product_of_rotations_turns_as_one_after_the_other(one, other, vector):
    a, b = quaternion.normalized(one), quaternion.normalized(other)
    turned = quaternion.matrix(a) @ (quaternion.matrix(b) @ np.array(vector))
    np.testing.assert_allclose(quaternion.matrix(quaternion.product(a, b)) @ vector, turned, atol=1e-12)


@given(vector=st.tuples(*[st.floats(-1.7, 1.7)] * 3))
def test_the_logarithm_inverts_the_exponential(vector):
    np.testing.assert_allclose(quaternion.logarithm(quaternion.exponential(np.array(vector))), vector, atol=1e-9)


def test_a_rotation_of_any_length_is_normalized_and_zero_is_refused():
    np.testing.assert_allclose(Pose.of(rotation=(3, 0, 0, 4)).rotation, (0.6, 0, 0, 0.8))
    with pytest.raises(InputError, match="quaternion zero"):
        Pose.of(rotation=(0, 0, 0, 0))
    with pytest.raises(InputError, match="four finite numbers"):
        Pose.of(rotation=(1, 0, 0))
    with pytest.raises(InputError, match="three numbers of meters"):
        Pose.of((0, math.nan, 0))


@given(
    times=st.lists(st.floats(0, 10), min_size=2, max_size=5, unique_by=lambda t: round(t, 2)),
    places=st.lists(vectors, min_size=5, max_size=5),
    turns=st.lists(rotations, min_size=5, max_size=5),
    smooth=st.booleans(),
)
def test_a_curve_passes_its_keys(times, places, turns, smooth):
    times = sorted(times)
    keys = [Pose.of(place, turn) for place, turn in zip(places, turns, strict=True)][: len(times)]
    curve = PoseCurve(np.array(times), keys, smooth)
    for time, key in zip(times, keys, strict=True):
        found = curve.pose(time)
        np.testing.assert_allclose(found.position, key.position, atol=1e-9)
        assert same_rotation(found.rotation, key.rotation)


def test_a_smooth_curve_does_not_overshoot_and_rests_at_its_ends():
    keys = [Pose.of((x, 0, 0), quaternion.about_axis((0, 0, 1), x)) for x in (0.0, 0.0, 1.0, 1.0)]
    curve = PoseCurve(np.array([0.0, 1.0, 1.5, 3.0]), keys)
    poses = [curve.pose(time) for time in np.linspace(-0.5, 3.5, 401)]
    x = np.array([pose.position[0] for pose in poses])
    angle = np.array([quaternion.logarithm(pose.rotation)[2] for pose in poses])
    assert (np.diff(x) >= -1e-12).all() and x.min() == 0 and x.max() == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(angle, x, atol=1e-9)  # about one axis the rotation follows the same curve
    assert np.abs(np.diff(x, 2)).max() < 3e-3  # no jump of the velocity


def test_the_shorter_way_is_taken():
    start, end = Pose.of(), Pose.of(rotation=quaternion.about_axis((0, 0, 1), math.radians(350)))
    middle = between(start, end, 0.5)
    assert same_rotation(middle.rotation, quaternion.about_axis((0, 0, 1), math.radians(-5)))


def test_a_spin_turns_about_its_point():
    pose = Spin(axis=(0, 0, 1), point=(0, 2, 0), turns=0.25).pose_function(REST)
    np.testing.assert_allclose(pose(0.0).array, REST.array)
    np.testing.assert_allclose(pose(1.0).position, (0, 3, 3), atol=1e-12)
    assert same_rotation(pose(1.0).rotation, quaternion.about_axis((0, 0, 1), math.pi / 2))
    own = Spin(rate=math.pi).pose_function(REST)
    np.testing.assert_allclose(own(1.0).position, REST.position)


def test_what_a_keyframe_leaves_out_is_as_at_rest():
    pose = Motion(keyframes=[Keyframe(time=1.0, position=(0.0, 0.0, 1.0))]).pose_function(REST)
    np.testing.assert_allclose(pose(5.0).array, (0, 0, 1, 1, 0, 0, 0))


def test_a_file_of_poses_moves_like_keyframes(tmp_path):
    (tmp_path / "p.csv").write_text(HEADER + "0,0,0,0,1,0,0,0\n\n1,1,0,0,0,0,0,2\n")
    pose = Motion(file="p.csv", between="linear").pose_function(REST, tmp_path)
    np.testing.assert_allclose(pose(0.5).position, (0.5, 0, 0))
    assert same_rotation(pose(0.5).rotation, quaternion.about_axis((0, 0, 1), math.pi / 2))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("t,x\n", "the first line of a file of poses is time,x,y,z,qw,qx,qy,qz"),
        (HEADER, "holds no pose"),
        (HEADER + "0,0,0,0,1,0,0,0\n0,0,0,0,1,0,0,0\n", "line 3: time 0 s is not after 0 s of the line before"),
        (HEADER + "0,0,0,0,0,0,0,0\n", "line 2: a pose: a rotation cannot be the quaternion zero"),
        (HEADER + "0,0,0,0,1,0,0\n", "line 2: it is not 8 finite numbers"),
        (HEADER + "0,0,0,x,1,0,0,0\n", "line 2: could not convert"),
    ],
)
def test_an_unusable_file_of_poses_is_refused_by_its_line(tmp_path, text, complaint):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=complaint):
        read_poses(tmp_path / "p.csv")


def test_a_missing_file_of_poses_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read as a file of poses"):
        read_poses(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("motion", "complaint"),
    [
        ("{keyframes: [{time: 1}, {time: 0.5}]}", "keyframe 1 at 0.5 s is not after the one before at 1 s"),
        ("{keyframes: []}", "at least 1 item"),
        ("{}", "exactly one of keyframes, spin, file and gltf, found none"),
        ("{spin: {rate: 1}, file: a.csv}", "found spin and file"),
        ("{spin: {axis: [0, 0, 0], rate: 1}}", "axis must not be zero"),
        ("{spin: {}}", "either rate in rad/s or turns"),
        ("{spin: {turns: 100}}", "too fast"),
        ("{keyframes: [{time: 0, rotation: [0, 0, 0, 0]}]}", "quaternion zero"),
        ("{keyframes: [{time: 0, rotation: [1, 0]}]}", "must be a quaternion"),
        ("{keyframes: [{time: 0, rotation: {axis: [0, 0, 0], degrees: 1}}]}", "axis must not be zero"),
    ],
)
def test_an_unusable_motion_is_refused_in_one_line(motion, complaint):
    text = WATER + f"surfaces: {{ball: {{sphere: {{radius: 0.1}}, motion: {motion}}}}}"
    with pytest.raises(InputError, match=complaint) as caught:
        Scene.from_yaml(text, "scene.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("radius", "fastest"), [(0.015, 80), (0.06, 40), (0.00375, 160)])
@pytest.mark.parametrize("place", ["surfaces.ball", "container"])
def test_a_spin_is_at_most_two_fifths_of_a_turn_in_a_frame(radius, fastest, place):
    text = {
        "surfaces.ball": "surfaces: {ball: {sphere: {radius: 0.1}, motion: {spin: {turns: %g}}}}",
        "container": "container: {size: [1, 1, 2], motion: {spin: {turns: %g}}}",
    }[place]
    water = "fluid: [{block: {min: [-0.4, -0.4, 1], max: [0.4, 0.4, 1.8]}}]\n"
    scene = Scene.from_yaml(f"{water}particle_radius: {radius}\n{text % fastest}", "test")
    with pytest.raises(InputError, match=rf"{place}: turns too fast for frames of .* at most {fastest} turns a second"):
        Scene.from_yaml(f"{water}particle_radius: {radius}\n{text % -(fastest + 1)}", "test")
    with pytest.raises(InputError, match="turns too fast"):
        scene.with_changes(particle_radius=1.5 * radius)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("surface: {sphere: {radius: 0.1}, motion: {spin: {rate: 1}}}", "only a surface with a name of its own moves"),
        (
            "surfaces: {a: {union: [{sphere: {radius: 0.1}, motion: {spin: {rate: 1}}}]}}",
            "only a surface with a name of its own moves",
        ),
        ("surface: {sphere: {radius: 0.1}}\nsurfaces: {a: {sphere: {radius: 0.1}}}", "either surface or surfaces"),
        ("surfaces: {sphere: {radius: 0.1}}", "'sphere' is a kind of surface, not a name"),
        ("surfaces: {container: {sphere: {radius: 0.1}}}", "'container' cannot be the name"),
        ("surfaces: {a: {sphere: {radius: 0.1}}, a: {sphere: {radius: 0.2}}}", "key 'a' occurs twice"),
        ("container: {open: true, motion: {spin: {rate: 1}}}", "no walls that could move"),
    ],
)
def test_what_may_not_move_and_names_that_mean_something_else_are_refused(text, complaint):
    with pytest.raises(InputError, match=complaint):
        Scene.from_yaml(WATER + text, "scene.yaml")


MOVING = WATER + (
    "surfaces:\n"
    "  floor: {box: {size: [1, 1, 0.1]}}\n"
    "  lid: {box: {size: [1, 1, 0.1]}, at: [0, 0, 1.5]}\n"
    "  paddle:\n"
    "    box: {size: [0.2, 0.1, 0.1]}\n"
    "    at: [0, 0, 0.5]\n"
    "    motion: {keyframes: [{time: 0, rotation: {axis: [0, 0, 1], degrees: 90}}]}\n"
)


def test_what_stands_still_is_one_surface_and_what_moves_is_in_its_own_frame():
    import torch

    scene = Scene.from_yaml(MOVING, "test")
    solids = build_solids(scene)
    points = torch.tensor([[0.0, 0.0, 0.2], [0.0, 0.0, 1.2]])
    np.testing.assert_allclose(solids.still.distance(points), [0.15, 0.25], atol=1e-6)
    np.testing.assert_allclose(scene.build_surface().distance(points), [0.15, 0.25], atol=1e-6)
    (paddle,) = solids.moving
    np.testing.assert_allclose(paddle.surface.bounds(), [[-0.1, -0.05, -0.05], [0.1, 0.05, 0.05]], atol=1e-6)
    start = solids.at_time(0.0)  # the long side is along y
    np.testing.assert_allclose(start.distance(torch.tensor([[0.0, 0.2, 0.5], [0.2, 0.0, 0.5]])), [0.1, 0.15], atol=1e-6)


def test_a_scene_with_motions_is_written_as_it_was_read(tmp_path):
    shaken = "container: {size: [1, 1, 2], motion: {file: shake.csv}}\n"
    scene = Scene.from_yaml(shaken + MOVING, "test", tmp_path)
    assert scene.moves
    again = Scene.from_yaml(scene.to_yaml(), "again", tmp_path)
    assert again == scene
    moved = scene.with_paths_relative_to(tmp_path / "out", root=tmp_path)
    assert str(moved.container.motion.file) == "../shake.csv"
    assert Scene.from_yaml(WATER + "container: none", "test").to_yaml().count("open: true") == 1
