import math

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

from surfsup.errors import InputError
from surfsup.scene import Scene
from surfsup.scene.assembly import write_assembly
from surfsup.scene.gltf_motion import GltfMotion
from surfsup.scene.gltf_track import Track
from surfsup.scene.motion import Motion
from surfsup.scene.pose import Pose
from tests.scene.gltf_files import write_animated

HALF = math.sqrt(0.5)
TURN_X, TURN_Y = (HALF, 0, 0, HALF), (0, HALF, 0, HALF)  # by 90 degrees, x, y, z, w
MOVE = ("go", 0, "translation", "LINEAR", [1, 3], [(0, 0, 0), (0, 2, 0)])


def motion(tmp_path, nodes, channels, node="cup", **options):
    return GltfMotion(write_animated(tmp_path / "a.glb", nodes, channels), node, **options)


class TestTrack:
    def test_linear_keys_are_joined_by_lines_and_kept_outside(self):
        track = Track(np.array([1.0, 3.0]), np.array([[0, 0, 0], [2, 4, 6.0]]), "LINEAR", False)
        np.testing.assert_allclose(
            [track.at(time) for time in (0, 1, 1.5, 3, 9)], np.outer([0, 0, 0.25, 1, 1], [2, 4, 6])
        )

    def test_steps_hold_a_key_until_the_next(self):
        track = Track(np.array([0.0, 1.0, 2.0]), np.array([[1.0], [2.0], [3.0]]), "STEP", False)
        assert [track.at(time)[0] for time in (-1, 0, 0.99, 1, 1.99, 2, 5)] == [1, 1, 1, 2, 2, 3, 3]

    @given(st.lists(st.floats(-2, 2), min_size=9, max_size=9), st.floats(0.1, 2), st.floats(0, 1))
    def test_a_cubic_spline_has_its_values_and_tangents(self, numbers, step, part):
        values = np.array(numbers).reshape(3, 3, 1)
        times = np.cumsum([0.5, step, 2 * step])
        spline = CubicHermiteSpline(times, values[:, 1, 0], values[:, 2, 0])
        # In glTF the tangents before and after a key may differ.
        spline = CubicHermiteSpline(times[:2], values[:2, 1, 0], [values[0, 2, 0], values[1, 0, 0]])
        time = times[0] + part * step
        track = Track(times, values, "CUBICSPLINE", False)
        np.testing.assert_allclose(track.at(time), spline(time), atol=1e-9)

    @given(st.lists(st.floats(-1, 1), min_size=8, max_size=8), st.floats(0, 1))
    def test_linear_rotations_turn_at_constant_rate_the_shorter_way(self, numbers, part):
        keys = np.array(numbers).reshape(2, 4)
        if np.linalg.norm(keys, axis=1).min() < 0.1:
            return
        keys /= np.linalg.norm(keys, axis=1, keepdims=True)
        found = Track(np.array([0.0, 1.0]), keys, "LINEAR", True).at(part)
        between = Slerp([0, 1], Rotation.from_quat(keys))(part)
        if abs(keys[0] @ keys[1]) > 1e-3:  # else both ways are equally short
            assert (Rotation.from_quat(found) * between.inv()).magnitude() < 1e-6

    def test_cubic_rotations_are_of_length_one(self):
        values = np.array([[(0, 0, 0, 0), TURN_X, (0, 0, 0, 0)], [(0, 0, 0, 0), TURN_Y, (0, 0, 0, 0)]], float)
        track = Track(np.array([0.0, 1.0]), values, "CUBICSPLINE", True)
        assert np.linalg.norm(track.at(0.5)) == pytest.approx(1)
        np.testing.assert_allclose(track.at(0.5), np.array([HALF, HALF, 0, 2 * HALF]) / math.sqrt(3), atol=1e-12)


class TestPose:
    def test_what_is_up_in_the_file_is_up_in_the_scene(self, tmp_path):
        path = motion(tmp_path, [{"name": "cup"}], [MOVE])
        np.testing.assert_allclose(path.pose(2).position, (0, 0, 1), atol=1e-7)
        turned = motion(tmp_path, [{"name": "cup"}], [("go", 0, "rotation", "LINEAR", [0, 1], [(0, 0, 0, 1), TURN_Y])])
        # A turn about y, up in the file, is one about z, up in the scene.
        np.testing.assert_allclose(turned.pose(1).apply(np.array([[1.0, 0, 0]])), [[0, 1, 0]], atol=1e-6)
        np.testing.assert_allclose(
            turned.pose(0.5).rotation, (math.cos(math.pi / 8), 0, 0, math.sin(math.pi / 8)), atol=1e-6
        )

    def test_what_carries_a_node_moves_it_too(self, tmp_path):
        nodes = [
            {"name": "arm", "children": [1], "translation": [1, 0, 0]},
            {"name": "hand", "children": [2], "translation": [0, 0, 2], "scale": [2, 2, 2]},
            {"name": "cup", "translation": [1, 0, 0]},
        ]
        channels = [
            ("turn", 0, "rotation", "LINEAR", [0, 1], [(0, 0, 0, 1), TURN_Y]),
            ("reach", 2, "translation", "STEP", [0, 1], [(1, 0, 0), (2, 0, 0)]),
        ]
        path = motion(tmp_path, nodes, channels)
        # At 1 s (4, 0, 2) from the arm is turned to (2, 0, -4), then moved by (1, 0, 0): with z up that is (3, 4, 0).
        np.testing.assert_allclose(path.pose(1).position, (3, 4, 0), atol=1e-6)
        np.testing.assert_allclose(path.scale, (2, 2, 2), atol=1e-6)
        assert set(path.times) == {0, 1}
        with pytest.raises(InputError, match="does not move the node 'hand'; its animations move cup"):
            motion(tmp_path, nodes, channels[1:], "hand")

    @pytest.mark.parametrize(
        ("nodes", "channels", "options", "message"),
        [
            ([{"name": "cup"}], [], {}, "does not move the node 'cup'; it has no animation"),
            ([{"name": "cup"}], [MOVE], {"node": "cap"}, "no node 'cap'; did you mean 'cup'"),
            ([{"name": "cup"}, {"name": "cup"}], [MOVE], {}, "2 nodes with the name 'cup'"),
            ([{"name": "cup"}], [MOVE], {"animation": "stay"}, "no animation 'stay'; it has go"),
            ([{"name": "cup"}], [MOVE, ("back", *MOVE[1:])], {}, "several animations of the node 'cup'"),
            ([{"name": "cup", "matrix": list(np.eye(4).ravel())}], [MOVE], {}, "'cup', which has a matrix"),
            ([{"name": "cup", "scale": [1, -1, 1]}], [MOVE], {}, "mirrors the node"),
            ([{"name": "cup", "scale": [0, 1, 1]}], [MOVE], {}, "to nothing"),
            (
                [{"name": "cup"}],
                [("go", 0, "scale", "LINEAR", [0, 1], [(1, 1, 1), (2, 2, 2)])],
                {},
                "changes the scale of the node 'cup'",
            ),
            ([{"name": "cup"}], [("go", 0, "translation", "LINEAR", [1, 0], [(0, 0, 0)] * 2)], {}, "do not increase"),
            ([{"name": "cup"}], [("go", 0, "translation", "LINEAR", [0, 1], [(0, 0, 0)] * 3)], {}, "2 keys have 3"),
            ([{"name": "cup"}], [("go", 0, "translation", "BEZIER", [0, 1], [(0, 0, 0)] * 2)], {}, "'BEZIER'"),
            ([{"name": "cup"}], [("go", 0, "rotation", "LINEAR", [0], [(0, 0, 0, 0)])], {}, "quaternion zero"),
        ],
    )
    def test_what_cannot_be_a_motion_is_refused_in_one_line(self, tmp_path, nodes, channels, options, message):
        with pytest.raises(InputError, match=message) as error:
            motion(tmp_path, nodes, channels, **options)
        assert "\n" not in str(error.value)

    def test_one_of_several_animations_is_named(self, tmp_path):
        channels = [MOVE, ("back", 0, "translation", "LINEAR", [1, 3], [(0, 0, 0), (0, -2, 0)])]
        assert motion(tmp_path, [{"name": "cup"}], channels, animation="back").pose(3).position[2] == pytest.approx(-2)

    @pytest.mark.parametrize("content", [b"", b"glTF", b"glTF\x02\0\0\0", b"{}", b'{"nodes": 3}', b"\xff\xfe"])
    def test_a_damaged_file_is_one_line(self, tmp_path, content):
        (tmp_path / "a.glb").write_bytes(content)
        with pytest.raises(InputError, match=r"a\.glb: ") as error:
            GltfMotion(tmp_path / "a.glb", "cup")
        assert "\n" not in str(error.value)
        with pytest.raises(InputError, match="cannot be read"):
            GltfMotion(tmp_path / "b.glb", "cup")


class TestSceneFile:
    def test_a_surface_follows_its_node(self, tmp_path):
        write_animated(tmp_path / "a.glb", [{"name": "cup"}], [MOVE])
        text = (
            "surfaces:\n  cup:\n    box: {size: [0.1, 0.1, 0.1]}\n"
            "    motion: {gltf: a.glb, node: cup, scale: 0.5, offset: [0, 0, 0.2]}\n"
            "fluid: [{block: {min: [-0.1, -0.1, 1.5], max: [0.1, 0.1, 1.7]}}]\n"
        )
        (tmp_path / "scene.yaml").write_text(text)
        scene = Scene.load(tmp_path / "scene.yaml")
        again = Scene.from_yaml(scene.to_yaml(), "test", tmp_path)
        for each in (scene, again):
            pose = each.surfaces["cup"].motion.pose_function(Pose.of(), tmp_path)(2.0)
            np.testing.assert_allclose(pose.position, (0, 0, 0.7), atol=1e-7)
        (tmp_path / "deeper").mkdir()
        moved = scene.with_paths_relative_to(tmp_path / "deeper", tmp_path)
        assert str(moved.surfaces["cup"].motion.gltf) == "../a.glb"

    @pytest.mark.parametrize(
        ("values", "message"),
        [
            ({"gltf": "a.glb"}, "needs the name of its node"),
            ({"gltf": "a.glb", "node": "cup", "spin": {"turns": 1}}, "exactly one of"),
            ({"gltf": "a.glb", "node": "cup", "between": "linear"}, "between has no meaning beside gltf"),
            ({"spin": {"turns": 1}, "node": "cup"}, "node has no meaning beside spin"),
            ({"gltf": "a.glb", "node": "cup", "scale": 0}, "scale"),
        ],
    )
    def test_keys_that_contradict_are_refused(self, values, message):
        with pytest.raises(InputError, match=message):
            Motion(**values)


@pytest.mark.parametrize("fit", [None, 0.5])
def test_an_animated_assembly_moves_as_its_file_does(tmp_path, fit):
    nodes = [
        {"name": "table"},
        {"name": "robot arm", "children": [2], "translation": [0, 0.5, 0]},
        {"name": "a cup", "translation": [0, 0.6, 0], "rotation": TURN_X, "scale": [1, 2, 1]},
    ]
    channels = [
        ("go", 1, "rotation", "LINEAR", [0, 2], [(0, 0, 0, 1), TURN_Y]),
        ("go", 2, "translation", "LINEAR", [0, 2], [(0, 0.6, 0), (0.2, 0.6, 0)]),
    ]
    cup = trimesh.creation.box((0.2, 0.2, 0.2), trimesh.transformations.translation_matrix((0.05, 0, 0)))
    table = trimesh.creation.box((0.6, 0.2, 0.6), trimesh.transformations.translation_matrix((0, 0.1, 0)))
    source = write_animated(tmp_path / "parts.glb", nodes, channels, {0: table, 2: cup})
    assert sorted(write_assembly(source, tmp_path / "scene.yaml", fit)) == ["a-cup", "table"]
    scene = Scene.load(tmp_path / "scene.yaml")
    scale, shift = (1.0, 0.0) if fit is None else (fit / 1.2, 0.0)  # it is 1.2 m high and stands on the ground
    path = GltfMotion(source, "a cup")
    entry = scene.surfaces["a-cup"]
    mesh = trimesh.load(tmp_path / "scene-files" / "a-cup.ply")
    for time in (0.0, 0.7, 2.0):
        pose = entry.motion.pose_function(Pose.of(), tmp_path)(time)
        corners = np.c_[cup.vertices, np.ones(8)] @ path.matrix(time).T
        expected = scale * corners[:, [0, 2, 1]] * [1, -1, 1] + [0, 0, shift]
        found = pose.apply(np.asarray(mesh.vertices))
        np.testing.assert_allclose(np.sort(found, axis=0), np.sort(expected, axis=0), atol=1e-6)
    assert getattr(scene.surfaces["table"], "motion", None) is None
    with pytest.raises(InputError, match="y is up in its animation"):
        write_assembly(source, tmp_path / "other.yaml", fit, up="z")
