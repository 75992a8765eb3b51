"""A short part of the fault campaign, `benchmarks/faults.py`, and that it sees what is wrong."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import surfsup as sf

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "benchmarks"))

from fault_campaign.soundness import unsound  # noqa: E402
from fault_campaign.unusual import unusual_scene  # noqa: E402


def test_no_fault_ends_in_a_traceback_a_crash_or_a_wrong_result(tmp_path):
    command = [sys.executable, ROOT / "benchmarks/faults.py", "--short", "--json", tmp_path / "faults.json"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = json.loads((tmp_path / "faults.json").read_text())["rows"]
    assert {row["kind"] for row in rows} == {"mesh", "scene", "trajectory", "kill", "surroundings"}
    assert len(rows) >= 20


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A folder with a small trajectory, its summary, and the solid in its frames."""
    folder = tmp_path_factory.mktemp("sound")
    scene = sf.Scene.from_yaml(
        "container: {size: [0.4, 0.4, 0.4]}\nsurface: {sphere: {radius: 0.08}, at: [0, 0, 0.1]}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.2], max: [0.1, 0.1, 0.35]}}]\nframes: 4",
        "test",
    )
    (folder / "out").mkdir()
    sf.Simulation(scene, device="cpu").record(folder / "out" / "trajectory.h5")
    counts = dict.fromkeys(("penetrations", "out_of_container", "crossings", "entered", "left"), 0)
    (folder / "out" / "summary.json").write_text(json.dumps(counts))
    return folder


def into_the_solid(file):
    file["00000/position"][3, 5] = [0, 0, 0.1]


def through_a_wall(file):
    file["00000/position"][2, 0] = [0.3, 0, 0.3]


def a_push(file):
    file["00000/velocity"][3] = 3.0


def no_number(file):
    file["00000/velocity"][1, 7, 2] = np.nan


def a_lost_frame(file):
    for name in ("position", "velocity"):
        data = file[f"00000/{name}"][:3]
        del file[f"00000/{name}"]
        file[f"00000/{name}"] = data


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (None, ""),
        (into_the_solid, "1 in a solid"),
        (through_a_wall, "1 out of the container"),
        (a_push, "gained"),
        (no_number, "frame 1 has values that are not finite"),
        (a_lost_frame, "3 of 4 frames"),
    ],
)
def test_the_campaign_sees_what_is_wrong_with_a_trajectory(run, tmp_path, spoil, complaint):
    shutil.copytree(run, tmp_path / "run")
    if spoil:
        with h5py.File(tmp_path / "run" / "out" / "trajectory.h5", "r+") as file:
            spoil(file)
    found = unsound(tmp_path / "run")
    assert complaint in found if complaint else found == ""


def test_the_campaign_believes_a_summary_that_admits_a_fault(run, tmp_path):
    shutil.copytree(run, tmp_path / "run")
    summary = tmp_path / "run" / "out" / "summary.json"
    summary.write_text(summary.read_text().replace('"crossings": 0', '"crossings": 2'))
    assert unsound(tmp_path / "run") == "2 crossings"


def test_an_unusual_scene_is_the_same_for_the_same_seed():
    one, other = (unusual_scene(np.random.default_rng(5)) for _ in range(2))
    assert one == other
    sf.Scene.from_yaml(json.dumps(one[1]), "test")
