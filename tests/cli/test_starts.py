"""Particle size, frame rate, fills and restarts from the command line."""

import json

import numpy as np
import pytest

from surfsup.io.trajectory import Trajectory
from tests.cli.test_cli import surfsup

CUP = """
surface: {bowl: {capture_radius: 0.15}, at: [0, 0, 0.25]}
fluid: [{fill: {below: 0.2}}]
frames: 10
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(CUP)
    return path


def simulate(scene, out, *options):
    return surfsup("simulate", scene, "-o", out, "--no-video", *options)


def test_radius_rate_and_duration_are_in_the_trajectory_and_in_its_page(scene, tmp_path):
    done = simulate(scene, tmp_path / "a", "--particle-radius", 0.01, "--fps", 100, "--duration", 0.2)
    assert done.returncode == 0, done.stderr
    with Trajectory(tmp_path / "a" / "trajectory.h5") as trajectory:
        assert (trajectory.radius, len(trajectory), trajectory.start_time) == (0.01, 20, 0.0)
        assert trajectory.frame_time == pytest.approx(0.01)
        assert trajectory.scene.particle_radius == 0.01 and trajectory.scene.fps == 100
        count = trajectory.positions.shape[1]
    assert json.loads((tmp_path / "a" / "summary.json").read_text())["penetrations"] == 0
    page = (tmp_path / "a" / "page.html").read_text()
    assert '"frameTime":0.01' in page and '"radius":0.01' in page
    assert simulate(scene, tmp_path / "b").returncode == 0
    with Trajectory(tmp_path / "b" / "trajectory.h5") as trajectory:
        assert trajectory.frame_time == 0.005 and trajectory.positions.shape[1] < count


def test_a_restart_continues_at_the_last_frame(scene, tmp_path):
    assert simulate(scene, tmp_path / "a").returncode == 0
    done = simulate(scene, tmp_path / "b", "--restart", tmp_path / "a" / "trajectory.h5")
    assert done.returncode == 0, done.stderr
    with Trajectory(tmp_path / "a" / "trajectory.h5") as first, Trajectory(tmp_path / "b" / "trajectory.h5") as second:
        np.testing.assert_array_equal(second.positions[0], first.positions[-1])
        assert second.start_time == pytest.approx(0.045)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--particle-radius", 0.2), "particle_radius: must be from 0.001 to 0.1 m"),
        (("--frames", 7, "--duration", 4), "frames: 7 contradicts a duration of 4 s"),
        (("--fps", 1000), "fps: must be at most 200"),
        (("--restart", "absent.h5"), "absent.h5: there is no such file of particles"),
    ],
)
def test_options_out_of_range_are_an_error_of_one_line(scene, tmp_path, options, message):
    done = simulate(scene, tmp_path / "a", *options)
    assert done.returncode == 2 and message in done.stderr
    assert done.stderr.count("\n") == 1 and not (tmp_path / "a").exists()
