"""The Alembic file, read by Blender."""

import json
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.exporting import formats
from surfsup.exporting.export import export
from surfsup.io.trajectory import Trajectory
from tests.exporting.test_export import COARSE, names

pytest.importorskip("pxr", reason="needs the extra 'export'")
needs_blender = pytest.mark.skipif(find_spec("bpy") is None, reason="needs the package bpy")

QUESTIONS = """
import bpy, json, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.render.fps = 25
bpy.ops.wm.alembic_import(filepath=sys.argv[1], set_frame_range=True, as_background_job=False)
bpy.data.cache_files[0].velocity_unit = "SECOND"
answer = {"frames": [scene.frame_start, scene.frame_end]}
scene.frame_set(3)
graph = bpy.context.evaluated_depsgraph_get()
for name in ("Particles", "Surface", "Solid"):
    shape = bpy.data.objects[name].evaluated_get(graph)
    answer[name] = [list(shape.matrix_world @ point.co) for point in shape.data.vertices]
    if "velocity" in shape.data.attributes:
        answer[name + " velocity"] = [list(value.vector) for value in shape.data.attributes["velocity"].data]
print("ANSWER", json.dumps(answer))
"""


@needs_blender
def test_blender_reads_the_trajectory(trajectory, tmp_path):
    done = export(trajectory, "alembic", tmp_path, fps=25, reconstruction=COARSE)
    assert done.files == (tmp_path / "water.abc",) and names(tmp_path) == ["water.abc"]
    command = [sys.executable, "-c", QUESTIONS, tmp_path / "water.abc"]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    answer = json.loads(next(line for line in printed.splitlines() if line.startswith("ANSWER")).partition(" ")[2])
    assert answer["frames"] == [1, 8]
    with Trajectory(trajectory) as file:
        positions, velocities = file.positions[16], file.velocities[16]
    np.testing.assert_allclose(answer["Particles"], positions, atol=1e-6)
    np.testing.assert_allclose(answer["Particles velocity"], velocities, atol=1e-6)
    for end in (np.min, np.max):
        np.testing.assert_allclose(end(answer["Surface"], axis=0), end(positions, axis=0), atol=0.04)
    assert np.mean(answer["Surface velocity"], axis=0)[2] == pytest.approx(velocities[:, 2].mean(), abs=0.2)
    np.testing.assert_allclose(np.linalg.norm(np.array(answer["Solid"]) - [0, 0, 0.2], axis=1), 0.2, atol=1e-3)
    with pytest.raises(InputError, match=r"water.abc: exists already"):
        export(trajectory, "alembic", tmp_path)


def test_without_blender_the_command_is_named(monkeypatch, trajectory, tmp_path):
    monkeypatch.setattr(formats, "find_spec", lambda name: None if name == "bpy" else object())
    with pytest.raises(InputError, match="needs Blender as a Python package: pip install bpy"):
        export(trajectory, "alembic", tmp_path)


def test_the_upward_axis_is_that_of_alembic():
    form = formats.format_named("alembic")
    assert form.up_axis(None) == form.up_axis("y") == "z", "Blender turns the frames"
    with pytest.raises(InputError, match="always y; omit --up"):
        form.up_axis("z")


@needs_blender
def test_what_blender_cannot_write_is_one_line_and_leaves_nothing(trajectory, tmp_path, monkeypatch):
    monkeypatch.setattr("surfsup.exporting.alembic.SCRIPT", tmp_path / "missing.py")
    out = tmp_path / "out"
    with pytest.raises(InputError, match=r"water.abc: Blender could not write it \(.*missing.py"):
        export(trajectory, "alembic", out, fps=10, what="particles")
    assert names(out) == []
