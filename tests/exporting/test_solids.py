"""Solids that move."""

import json
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import h5py
import numpy as np
import pytest
import pyvista

import surfsup as sf
from surfsup.exporting.export import export
from surfsup.io.trajectory_format import POSES, Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.native.dispatch import is_built
from surfsup.scene import Scene
from surfsup.scene.assembly import gltf_parts
from surfsup.scene.gltf_motion import GltfMotion
from surfsup.scene.pose import Pose
from surfsup.simulation import Simulation
from surfsup.viewing.trajectory_page import write_trajectory_page

SPIN = """
surfaces:
  paddle: {box: {size: [0.4, 0.06, 0.1]}, at: [0, 0, 0.1], motion: {spin: {axis: [0, 0, 1], turns: 1}}}
  ball: {sphere: {radius: 0.1}, at: [0.35, 0.35, 0.1]}
fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.6]}}]
frames: 51
"""


@pytest.fixture(scope="module")
def spin(tmp_path_factory) -> Path:
    if not is_built():
        pytest.skip("moving solids run in the C++ code")
    path = tmp_path_factory.mktemp("spin") / "spin.h5"
    Simulation(Scene.from_yaml(SPIN, "test", Path()), device="cpu").record(path)
    return path


def test_a_solid_that_moves_is_in_every_frame_with_its_velocity(spin, tmp_path):
    done = export(spin, "vtk", tmp_path, fps=16, what="solid")  # every 62.5 ms: a sixteenth of a turn
    assert done.frames == 5
    first, last = (pyvista.read(tmp_path / f"solid.{number:04d}.vtk") for number in (1, 5))
    moved = np.linalg.norm(first.points - [0.35, 0.35, 0.1], axis=1) > 0.15
    assert 0 < moved.sum() < len(moved)
    np.testing.assert_array_equal(first.points[~moved], last.points[~moved])  # the ball
    x, y, z = first.points[moved].T
    np.testing.assert_allclose(last.points[moved], np.stack([-y, x, z], axis=1), atol=1e-5)  # a quarter of a turn
    middle = pyvista.read(tmp_path / "solid.0003.vtk")
    x, y, _ = middle.points[moved].T
    expected = 2 * np.pi * np.stack([-y, x, np.zeros_like(x)], axis=1)
    np.testing.assert_allclose(middle["velocity"][moved], expected, atol=0.01)
    np.testing.assert_array_equal(middle["velocity"][~moved], 0)


@pytest.mark.parametrize("up", ["z", "y"])
def test_usd_has_moving_solids_as_transforms_with_time_samples(spin, tmp_path, up):
    pytest.importorskip("pxr", reason="needs the extra 'export'")
    from pxr import Usd, UsdGeom

    export(spin, "usd", tmp_path, fps=16, what="solid", up=up)
    stage = Usd.Stage.Open(str(tmp_path / "water.usdc"))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (1, 5)
    paddle, still = (UsdGeom.Mesh(stage.GetPrimAtPath(f"/Water/Solid/{name}")) for name in ("paddle", "still"))
    assert not paddle.GetPointsAttr().GetTimeSamples() and not still.GetXformOpOrderAttr().HasValue()
    assert [op.GetOpName() for op in paddle.GetOrderedXformOps()] == ["xformOp:translate", "xformOp:orient"]
    assert all(op.GetTimeSamples() == [1, 2, 3, 4, 5] for op in paddle.GetOrderedXformOps())
    own = np.array(paddle.GetPointsAttr().Get())
    export(spin, "vtk", tmp_path, fps=32, what="solid", up=up)
    for code in (1, 3, 5, 2.5):  # the last is between two samples
        there = np.array([paddle.ComputeLocalToWorldTransform(code).Transform(point) for point in own.tolist()])
        shown = pyvista.read(tmp_path / f"solid.{round(2 * code - 1):04d}.vtk").points
        paddle_shown, still_shown = shown[-len(own) :], shown[: -len(own)]
        np.testing.assert_allclose(there, paddle_shown, atol=1e-5)
        np.testing.assert_allclose(np.array(still.GetPointsAttr().Get()), still_shown, atol=1e-6)


WHERE = """
import bpy, json, sys
if sys.argv[1].endswith(".abc"):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = 16
    bpy.ops.wm.alembic_import(filepath=sys.argv[1], set_frame_range=True, as_background_job=False)
else:
    bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
bpy.context.scene.frame_set(3)
graph = bpy.context.evaluated_depsgraph_get()
paddle = bpy.data.objects["paddle"].evaluated_get(graph)
print("ANSWER", json.dumps([list(paddle.matrix_world @ point.co) for point in paddle.data.vertices]))
"""


@pytest.mark.skipif(find_spec("bpy") is None, reason="needs the package bpy")
@pytest.mark.parametrize("form", ["blender", "alembic"])
def test_blender_moves_solids(spin, tmp_path, form):
    done = export(spin, form, tmp_path, fps=16, what="solid")
    command = [sys.executable, "-c", WHERE, done.files[0]]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    answer = json.loads(next(line for line in printed.splitlines() if line.startswith("ANSWER")).partition(" ")[2])
    export(spin, "vtk", tmp_path, fps=16, what="solid")
    shown = pyvista.read(tmp_path / "solid.0003.vtk").points
    np.testing.assert_allclose(answer, shown[-len(answer) :], atol=1e-5)


def test_solids_have_valid_and_different_names_of_prims():
    pytest.importorskip("pxr", reason="needs the extra 'export'")
    from surfsup.exporting.usd_transforms import prim_names

    names = prim_names(["cup 1", "cup-1", "still", "2nd"], taken="still")
    assert names == {"cup 1": "cup_1", "cup-1": "cup_1_2", "still": "still_2", "2nd": "_nd"}


def test_walls_that_moved_away_do_not_stop_particles_between_two_frames(tmp_path):
    scene = Scene.from_yaml(
        "container: {size: [0.4, 0.4, 0.6], motion: {keyframes: [{time: 0, position: [0.1, 0, 0]}]}}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.1], max: [0.1, 0.1, 0.2]}}]\nframes: 2",
        "test",
    )
    place, velocity = np.float32([[0.18, 0, 0.3]]), np.float32([[20, 0, 0]])
    with TrajectoryWriter(tmp_path / "t.h5", scene, Provenance("test"), 1) as writer:
        for sign in (1, -1):  # there and back, by v t / 4 in between
            writer.append(place, sign * velocity)
    export(tmp_path / "t.h5", "npz", tmp_path / "out", fps=400)
    places = [np.load(file)["positions"][0, 0] for file in sorted((tmp_path / "out").glob("*.npz"))]
    np.testing.assert_allclose(places, [0.18, 0.205, 0.18], atol=1e-6)


def test_without_poses_in_the_file_solids_move_as_the_scene_says(spin, tmp_path):
    shutil.copy(spin, tmp_path / "t.h5")
    with h5py.File(tmp_path / "t.h5", "a") as file:
        del file[POSES]
    for name, file in (("with", spin), ("without", tmp_path / "t.h5")):
        export(file, "vtk", tmp_path / name, fps=16, what="solid")
        export(file, "npz", tmp_path / name, fps=16, what="particles")
    last = [pyvista.read(tmp_path / name / "solid.0005.vtk").points for name in ("with", "without")]
    np.testing.assert_allclose(*last, atol=1e-6)
    write_trajectory_page(tmp_path / "t.h5", tmp_path / "t.html", lambda done, total: None)
    assert (tmp_path / "t.html").is_file()


def test_glb_has_moving_solids_as_nodes_with_keyframes(spin, tmp_path):
    done = export(spin, "glb", tmp_path, fps=16, what="solid")
    assert done.files == (tmp_path / "solid.glb",) and [file.name for file in tmp_path.iterdir()] == ["solid.glb"]
    paddle = GltfMotion(tmp_path / "solid.glb", "paddle")
    np.testing.assert_allclose(paddle.times, np.arange(5) / 16, atol=1e-6)
    with sf.Trajectory(spin) as trajectory:
        for key, frame in ((0, 0), (0.25, 50)):
            pose = Pose.from_array(trajectory.poses["paddle"][frame])
            np.testing.assert_allclose(paddle.pose(key).position, pose.position, atol=1e-6)
            assert abs(paddle.pose(key).rotation @ pose.rotation) > 1 - 1e-6
    parts = dict(gltf_parts(tmp_path / "solid.glb", None)[0])
    np.testing.assert_allclose(parts["paddle"].bounds, [[-0.2, -0.03, 0.05], [0.2, 0.03, 0.15]], atol=0.002)
    np.testing.assert_allclose(parts["still"].bounds, [[0.25, 0.25, 0], [0.45, 0.45, 0.2]], atol=0.002)
