import csv
import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

from surfsup import Block, InputError, Scene, Trajectory
from surfsup.datasets.folder import lock_folder
from surfsup.sweep import sweep
from surfsup.sweep.contact_sheet import SIZE, distinct_moment, write_contact_sheet
from tests.dask_cluster import cluster  # noqa: F401

DROP = Scene(fluid=[Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=5)
SCENE = "surface: {sphere: {radius: 0.2}}\nfluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]\n"


def test_a_sweep_is_a_folder_for_each_case_and_a_table(tmp_path):
    done = sweep({"drop": DROP}, {"gravity.2": [-9.81, -1.62], "frames": [3, 5]}, tmp_path / "new")
    assert [case.name for case in done.finished] == ["drop-0", "drop-1", "drop-2", "drop-3"]
    assert [row["frames"] for row in done.rows] == [3, 5, 3, 5]
    for row, case in zip(done.rows, done.cases, strict=True):
        with Trajectory(tmp_path / "new" / case.name / "trajectory.h5") as trajectory:
            assert len(trajectory) == row["frames"]
            assert trajectory.scene.gravity[2] == row["gravity.2"]
            speed = np.linalg.norm(trajectory.velocities[:], axis=2).max()
            assert row["max_speed"] == pytest.approx(speed, abs=1e-4)
            assert row["center_height"] == pytest.approx(trajectory.positions[-1, :, 2].mean(), abs=1e-5)
    with (tmp_path / "new" / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["case"], float(row["gravity.2"])) for row in rows] == [
        (row["case"], row["gravity.2"]) for row in done.rows
    ]


def test_the_table_is_there_as_parquet_too(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    done = sweep({"drop": DROP}, {"frames": [2, 3]}, tmp_path)
    assert parquet.read_table(tmp_path / "table.parquet").to_pylist() == done.rows


def test_finished_cases_are_kept_and_missing_ones_simulated(tmp_path):
    sweep({"drop": DROP}, {"frames": [2, 3]}, tmp_path)
    files = [tmp_path / name / "trajectory.h5" for name in ("drop-0", "drop-1")]
    kept = files[0].stat().st_mtime_ns
    content = files[1].read_bytes()
    (tmp_path / "drop-1").rename(tmp_path / ".drop-1.1234.partial")  # as a killed run leaves it
    reports = []
    sweep({"drop": DROP}, {"frames": [2, 3]}, tmp_path, progress=lambda *report: reports.append(report))
    assert reports == [(1, 2), (2, 2)]
    assert files[0].stat().st_mtime_ns == kept
    assert files[1].read_bytes() == content
    assert not list(tmp_path.glob(".*.partial"))


def test_a_case_that_fails_has_its_message_in_the_table_and_the_others_are_there(tmp_path):
    # A block that the ball swallows leaves no particle.
    scene = Scene.from_yaml(SCENE + "frames: 3", "a")
    done = sweep({"a": scene}, {"surface.sphere.radius": [0.2, 0.95]}, tmp_path)
    assert [case.name for case in done.finished] == ["a-0"]
    assert list(done.errors) == ["a-1"]
    with (tmp_path / "table.csv").open() as file:
        assert [row["error"] != "" for row in csv.DictReader(file)] == [False, True]


def test_a_folder_of_another_sweep_is_refused_and_stays(tmp_path):
    sweep({"drop": DROP}, {"frames": [2]}, tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file() and path.name != ".lock"}
    for arguments in (
        ({"drop": DROP}, {"frames": [3]}, tmp_path),
        ({"other": DROP}, {"frames": [2]}, tmp_path),
        ({"drop": DROP}, {"frames": [2]}, tmp_path, "surfsup"),
    ):
        with pytest.raises(InputError, match=r"holds a sweep of (another simulator|other scenes or values)"):
            sweep(*arguments)
    assert before == {path: path.read_bytes() for path in before}
    (tmp_path / "sweep.json").write_text("{")
    with pytest.raises(InputError, match=r"sweep\.json: is damaged"):
        sweep({"drop": DROP}, {"frames": [2]}, tmp_path)


def test_a_second_run_in_the_same_folder_is_refused(tmp_path):
    with lock_folder(tmp_path), pytest.raises(InputError, match="another run is writing into it"):
        sweep({"drop": DROP}, {}, tmp_path)


def test_an_unknown_simulator_is_refused_before_the_folder_exists(tmp_path):
    with pytest.raises(InputError, match="nothing"):
        sweep({"drop": DROP}, {}, tmp_path / "new", "nothing")
    assert not (tmp_path / "new").exists()


def test_the_other_worker_of_a_scheduler_repeats_the_case_of_a_killed_one(tmp_path, cluster):  # noqa: F811
    scene, out = tmp_path / "drop.yaml", tmp_path / "out"
    scene.write_text(SCENE)
    command = [sys.executable, "-m", "surfsup.cli", "sweep", scene, "--vary", "frames=3000,3001,3002", "-o", out]
    options = ["--scheduler", cluster.address, "--no-pictures"]
    running = subprocess.Popen([*map(str, command), *options], stderr=subprocess.PIPE, text=True)
    while running.poll() is None and len(list(out.glob(".*.partial"))) < 2:
        time.sleep(0.01)
    cluster.workers[0].kill()
    _, output = running.communicate()
    assert running.returncode == 0, output
    assert "was lost, others do its work; 1 left" in output
    assert sorted(name for name in os.listdir(out) if not name.startswith(".")) == [
        "drop-0", "drop-1", "drop-2", "sweep.json", *sorted(path.name for path in out.glob("table.*")),
    ]  # fmt: skip
    assert [json.loads((out / f"drop-{number}" / "result.json").read_text())["frames"] for number in range(3)] == [
        3000, 3001, 3002,
    ]  # fmt: skip


def test_the_contact_sheet_has_a_picture_of_every_case(tmp_path):
    done = sweep({"drop": DROP}, {"gravity.2": [-9.81, -1.62]}, tmp_path)
    sheet = write_contact_sheet(tmp_path, done.finished)
    image = np.asarray(Image.open(sheet))
    assert image.shape == (SIZE[1], 2 * SIZE[0], 3)
    assert image.std() > 10


@pytest.mark.parametrize(("heights", "moment"), [([0.1, 0.12], 1.0), ([0.1, 0.46], 0.5), ([0.01, 0.02], 1.0)])
def test_the_contact_sheet_shows_a_time_at_which_the_cases_differ(tmp_path, heights, moment):
    """Water falls from 0.5 m on boxes, which it reaches after 0.28 s or at once; the last ones it does not reach."""
    scene = Scene.from_yaml(
        "surface: {box: {size: [0.3, 0.3, 0.1]}, at: [0, 0, 0]}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]\nframes: 61",
        "test",
    )
    done = sweep({"drop": scene}, {"surface.at.2": [height - 0.05 for height in heights]}, tmp_path)
    assert distinct_moment(tmp_path, done.finished) == moment
