"""`surfsup simulate --resume`: an interrupted simulation is continued in its folder."""

import json
import signal
import subprocess
import sys
import time

import numpy as np

from surfsup import Trajectory
from tests.cli.test_cli import handle_interrupts
from tests.cli.test_export import surfsup  # noqa: F401

SCENE = "frames: 30000\nfluid: [{block: {min: [-0.1, -0.1, 0.1], max: [0.1, 0.1, 0.3]}}]\n"


def test_after_an_interrupt_the_rest_is_simulated(tmp_path, surfsup):  # noqa: F811
    scene, out = tmp_path / "scene.yaml", tmp_path / "out"
    scene.write_text(SCENE)
    options = ["-o", out, "--no-page", "--no-video"]
    command = [sys.executable, "-m", "surfsup.cli", "simulate", scene, *options]
    running = subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE, text=True, preexec_fn=handle_interrupts)
    file = out / "trajectory.h5"
    while running.poll() is None and not (file.exists() and file.stat().st_size > 500_000):
        time.sleep(0.01)
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate()
    assert running.returncode == 130, errors
    with Trajectory(file) as kept:
        count, first = len(kept), kept.positions[:]
    assert 0 < count < 30000
    total = str(count + 20)
    status, printed, errors = surfsup("simulate", scene, *options, "--frames", total, "--resume")
    assert status == 0, errors
    assert f"125 particles, {total} frames" in printed
    with Trajectory(file) as whole:
        assert len(whole) == count + 20
        np.testing.assert_array_equal(whole.positions[:count], first)
        assert not np.array_equal(whole.positions[count], first[-1])
    status, _, errors = surfsup("simulate", scene, *options, "--frames", total, "--resume")
    assert (status, errors.count("\n")) == (2, 1)
    assert "has all" in errors


def test_times_add_up(tmp_path, surfsup):  # noqa: F811
    scene, out = tmp_path / "scene.yaml", tmp_path / "out"
    scene.write_text(SCENE)
    status, printed, _ = surfsup("simulate", scene, "-o", out, "--no-page", "--no-video", "--frames", 40)
    assert status == 0
    summary = json.loads((out / "summary.json").read_text())
    parts = summary["start_up"] + summary["writing"] + 38 * summary["ms_per_frame"] / 1000
    assert abs(summary["seconds"] - parts) < 0.02
    assert f"({summary['start_up']:.1f} s to start, {summary['ms_per_frame']:.1f} ms per frame" in printed
