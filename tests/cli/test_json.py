"""`--json`: the results of verbs for programs."""

import json

from tests.cli.test_export import surfsup  # noqa: F401

SCENE = "frames: 9\nfluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]\n"


def test_a_simulation_prints_its_summary_and_its_files(tmp_path, surfsup):  # noqa: F811
    scene, out = tmp_path / "scene.yaml", tmp_path / "out"
    scene.write_text(SCENE)
    options = ["--no-video", "--export", "vtk", "--export-fps", 50, "--json"]
    status, printed, errors = surfsup("simulate", scene, "-o", out, *options)
    assert status == 0, errors
    result = json.loads(printed)
    assert (result["particles"], result["frames"], result["penetrations"]) == (125, 9, 0)
    assert result["files"] == {"trajectory": str(out / "trajectory.h5"), "page": str(out / "page.html")}
    assert len(result["exported"]) >= 1
    summary = json.loads((out / "summary.json").read_text())
    assert {name: result[name] for name in summary} == summary


def test_the_doctor_lists_its_checks(surfsup):  # noqa: F811
    status, printed, _ = surfsup("doctor", "--json")
    checks = {check["name"]: check for check in json.loads(printed)}
    assert status == 0
    assert checks["Python"]["passed"] is True
    assert "ms of 2,160 particles on a ball takes" in checks["speed"]["found"]
