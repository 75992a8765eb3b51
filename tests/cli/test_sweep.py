"""`surfsup sweep`: what it writes and prints."""

import pytest

from tests.cli.test_export import surfsup  # noqa: F401

SCENE = "frames: 4\nfluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]\n"


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "drop.yaml"
    file.write_text(SCENE)
    return file


def test_it_names_the_table_and_a_second_call_keeps_what_is_there(scene, tmp_path, surfsup):  # noqa: F811
    out = tmp_path / "out"
    command = ("sweep", scene, "--vary", "gravity.2=-9.81:-1.62:2", "-o", out, "--no-pictures")
    status, printed, errors = surfsup(*command)
    assert (status, printed.splitlines()[:2]) == (0, [f"2 of 2 simulations in {out}", f"table    {out / 'table.csv'}"])
    assert "simulating: 2/2" in errors
    before = (out / "drop-0" / "trajectory.h5").stat().st_mtime_ns
    assert surfsup(*command)[0] == 0
    assert (out / "drop-0" / "trajectory.h5").stat().st_mtime_ns == before


def test_a_failed_case_is_named_at_the_end(scene, tmp_path, surfsup):  # noqa: F811
    scene.write_text(SCENE + "surface: {sphere: {radius: 0.1}, at: [0, 0, 0.1]}\n")
    out = tmp_path / "out"
    vary = "surface.sphere.radius=0.1,0.95"
    status, printed, errors = surfsup("sweep", scene, "--vary", vary, "-o", out, "--no-pictures")
    assert (status, printed.splitlines()[0]) == (1, f"1 of 2 simulations in {out}")
    assert errors.splitlines()[-1].startswith("surfsup: drop-1: ")


@pytest.mark.parametrize(
    ("scenes", "vary", "message"),
    [
        (["drop.yaml"], "gravity", "is not key=first:last:count or key=value,value"),
        (["drop.yaml"], "gravty.2=1,2", "drop has no 'gravty' there, but container"),
        (["drop.yaml", "drop.yaml"], "frames=1,2", "two scenes have the same name"),
        (["missing.yaml"], "frames=1,2", "missing.yaml: cannot be read as a scene: No such file"),
    ],
)
def test_bad_input_is_one_line_and_leaves_no_folder(scene, tmp_path, surfsup, scenes, vary, message):  # noqa: F811
    files = [scene.parent / name for name in scenes]
    status, _, errors = surfsup("sweep", *files, "--vary", vary, "-o", tmp_path / "out", "--no-pictures")
    assert (status, errors.count("\n")) == (2, 1)
    assert message in errors
    assert not (tmp_path / "out").exists()
