"""What the page of a trajectory imports; its content is tested beside its features."""

import subprocess
import sys

import numpy as np
import pytest

from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Scene
from surfsup.viewing.trajectory_page import write_trajectory_page

WATER = "fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]\nframes: 1"
BALL = "surface: {sphere: {radius: 0.1}}"


@pytest.mark.parametrize(
    ("file", "surface", "title"),
    [
        ("run-7/trajectory.h5", BALL, "sphere"),
        ("run-7/trajectory.h5", "", "run-7"),
        ("run-7/00003.h5", BALL, "00003: sphere"),
        ("run-7/00003.h5", "", "00003"),
    ],
)
def test_a_page_is_called_by_its_scene_or_else_its_folder(tmp_path, file, surface, title):
    path = tmp_path / file
    path.parent.mkdir()
    with TrajectoryWriter(path, Scene.from_yaml(f"{surface}\n{WATER}", "test"), Provenance("dfsph"), 1) as writer:
        writer.append(np.zeros((1, 3), np.float32), np.zeros((1, 3), np.float32))
    source = path.parent if path.name == "trajectory.h5" else path  # a folder stands for its trajectory
    page = write_trajectory_page(source, tmp_path / "page.html", lambda done, total: None).read_text()
    assert f"<title>{title} - surfsup</title>" in page and f"{title} · dfsph · 1 particles" in page


def test_a_simulation_with_a_page_imports_nothing_that_only_pictures_need():
    code = (
        "import sys, surfsup.simulation, surfsup.continuation, surfsup.viewing.trajectory_page; "
        "print([m for m in ('av', 'pyvista', 'vtkmodules', 'igl', 'warp', 'pandas') if m in sys.modules])"
    )
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"
