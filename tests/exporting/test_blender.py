"""The files for Blender, opened by Blender."""

import json
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.exporting.export import export
from surfsup.io.trajectory import Trajectory
from tests.exporting.test_export import COARSE, names

pytest.importorskip("pxr", reason="needs the extra 'export'")

QUESTIONS = """
import bpy, json, sys
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
answer = {"frames": [scene.frame_start, scene.frame_end], "fps": scene.render.fps / scene.render.fps_base}
answer["path"] = bpy.data.cache_files[0].filepath
answer["scale"] = scene.unit_settings.scale_length
scene.frame_set(3)
graph = bpy.context.evaluated_depsgraph_get()
for name in ("Particles", "Surface", "Solid"):
    shape = bpy.data.objects[name].evaluated_get(graph)
    points = shape.data.vertices if shape.type == "MESH" else shape.data.points
    answer[name] = [list(shape.matrix_world @ point.co) for point in points]
    if "velocity" in shape.data.attributes:
        answer[name + " velocity"] = [list(value.vector) for value in shape.data.attributes["velocity"].data]
radius = bpy.data.objects["Particles"].evaluated_get(graph).data.attributes["radius"].data
answer["radius"] = [value.value for value in radius]
print("ANSWER", json.dumps(answer))
"""


@pytest.fixture(scope="module")
def folder(trajectory, tmp_path_factory):
    out = tmp_path_factory.mktemp("blender")
    export(trajectory, "blender", out, fps=25, reconstruction=COARSE)
    return out


def test_a_script_that_python_can_read_opens_the_file_beside_it(folder):
    script = (folder / "open_in_blender.py").read_text()
    compile(script, "open_in_blender.py", "exec")
    assert '"water.usdc"' in script
    assert (
        {"open_in_blender.py", "water.usdc"}
        <= set(names(folder))
        <= {"open_in_blender.py", "water.blend", "water.usdc"}
    )


def test_an_older_script_stays_unless_it_may_be_overwritten(trajectory, tmp_path):
    (tmp_path / "open_in_blender.py").write_text("mine")
    with pytest.raises(InputError, match=r"open_in_blender.py: exists already"):
        export(trajectory, "blender", tmp_path)
    assert names(tmp_path) == ["open_in_blender.py"]


@pytest.mark.skipif(find_spec("bpy") is None, reason="needs the package bpy")
def test_blender_shows_the_trajectory(folder, trajectory):
    command = [sys.executable, "-c", QUESTIONS, folder / "water.blend"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    answer = json.loads(next(line for line in printed.splitlines() if line.startswith("ANSWER")).partition(" ")[2])
    assert (answer["frames"], answer["fps"], answer["scale"]) == ([1, 8], 25, 1)
    assert answer["path"] == "//water.usdc"
    with Trajectory(trajectory) as file:
        positions, velocities = file.positions[16], file.velocities[16]
    np.testing.assert_allclose(answer["Particles"], positions, atol=1e-6)
    np.testing.assert_allclose(answer["Particles velocity"], velocities, atol=1e-6)
    np.testing.assert_allclose(answer["radius"], 0.015)
    for end in (np.min, np.max):
        np.testing.assert_allclose(end(answer["Surface"], axis=0), end(positions, axis=0), atol=0.04)
    assert np.mean(answer["Surface velocity"], axis=0)[2] == pytest.approx(velocities[:, 2].mean(), abs=0.2)
    np.testing.assert_allclose(np.linalg.norm(np.array(answer["Solid"]) - [0, 0, 0.2], axis=1), 0.2, atol=1e-3)
