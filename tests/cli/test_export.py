"""`surfsup export` and `surfsup simulate --export`: what they write and print."""

import sys

import numpy as np
import pytest
import pyvista

from surfsup.cli import main
from tests.cli.test_cli import SCENE
from tests.exporting.conftest import trajectory  # noqa: F401


@pytest.fixture
def surfsup(monkeypatch, capsys):
    """Run the program in this process; returns its exit status, standard output and error."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["surfsup", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        printed = capsys.readouterr()
        return end.value.code, printed.out, printed.err

    return run


def test_a_simulation_exports_on_request_and_later(tmp_path, surfsup):
    scene, out = tmp_path / "scene.yaml", tmp_path / "out"
    scene.write_text(SCENE)
    status, printed, errors = surfsup(
        "simulate", scene, "-o", out, "--no-page", "--no-video", "--frames", 9, "--export", "vtk", "--export-fps", 50
    )
    assert status == 0, errors
    assert f"export      {out / 'export' / 'particles.0001.vtk'}  (3 frames)" in printed
    speeds = [pyvista.read(out / "export" / f"particles.{number:04d}.vtk")["velocity"][:, 2] for number in (1, 2, 3)]
    np.testing.assert_allclose(np.mean(speeds, axis=1), [0, -0.1962, -0.3924], atol=0.01)  # m/s after 0, 20, 40 ms
    file = out / "trajectory.h5"
    status, _, errors = surfsup(
        "export", file, "--to", "ply", "--fps", 25, "-o", tmp_path / "later", "--what", "all", "--cube-size", 1.5
    )
    assert status == 0, errors
    assert "exporting ply" in errors
    assert sorted(path.name for path in (tmp_path / "later").iterdir()) == [
        "particles.0001.ply", "particles.0002.ply", "solid.ply", "surface.0001.ply", "surface.0002.ply",
    ]  # fmt: skip
    status, _, errors = surfsup("export", file, "--to", "vtk")  # into the same folder
    assert (status, "exists already" in errors) == (2, True)


def test_an_unknown_format_is_refused_before_the_simulation(tmp_path, surfsup):
    scene, out = tmp_path / "scene.yaml", tmp_path / "out"
    scene.write_text(SCENE)
    status, _, errors = surfsup("simulate", scene, "-o", out, "--no-page", "--no-video", "--export", "bego")
    assert (status, errors.count("\n")) == (2, 1)
    assert "no export format 'bego'; did you mean 'bgeo'" in errors
    assert not out.exists()


def test_a_trajectory_that_was_cut_off_is_exported_with_status_2(trajectory, tmp_path, surfsup):  # noqa: F811
    cut = tmp_path / "cut.h5"
    cut.write_bytes(trajectory.read_bytes()[: int(0.7 * trajectory.stat().st_size)])
    status, printed, errors = surfsup("export", cut, "--to", "npz", "--fps", 200)
    assert (status, "cut off: only" in errors, "particles.0001.npz" in printed) == (2, True, True)
    assert 0 < len(list((tmp_path / "export").iterdir())) < 61
