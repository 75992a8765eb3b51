"""`surfsup fit` as users run it: in a process of its own, by its output files and its exit status."""

import signal
import subprocess
import sys

import h5py
import pytest
import trimesh

from surfsup.sdf import load_deepsdf, load_siren
from tests.cli.test_cli import surfsup

SMALL = ("width=24", "layers=2", "batch=64", "frequency=10", "samples=2000")
TINY = (*SMALL, "steps=40", "validate_every=20", "learning_rate=0.003")


@pytest.fixture
def ball(tmp_path):
    path = tmp_path / "ball.stl"
    trimesh.creation.icosphere(3, 25.0).export(path)
    return path


def test_water_is_poured_on_the_network_of_a_mesh(ball, tmp_path):
    out = tmp_path / "ball.safetensors"
    done = surfsup("fit", "siren", ball, "-o", out, *TINY)
    assert done.returncode == 0, done.stderr
    assert "error of the distance near the surface" in done.stdout
    assert "40 of 40 steps" in done.stdout
    surface = load_siren(out)
    assert surface.about["input"] == "ball.stl"
    assert set(surface.about["errors"]) == {"distance", "angle", "angle_on_surface", "chamfer", "parts"}
    assert surface.about["options"]["seed"] == 0
    again = surfsup("fit", "siren", ball, "-o", out, *TINY)
    assert again.returncode == 2
    assert "continue it with --resume" in again.stderr
    water = tmp_path / "water"
    poured = surfsup("simulate", out, "-o", water, "--frames", 5, "--no-video", "--no-page")
    assert poured.returncode == 0, poured.stderr
    with h5py.File(water / "trajectory.h5") as file:
        assert file["00000/position"].shape[0] == 5


def test_a_network_of_several_bowls_needs_the_name_of_one(tmp_path):
    out = tmp_path / "bowls.safetensors"
    done = surfsup(
        "fit", "deepsdf", "bowls", "-n", 2, "-o", out, "width=24", "layers=2", "code=2", "steps=60", "validate_every=20"
    )
    assert done.returncode == 0, done.stderr
    assert load_deepsdf(out).names == ["bowl-0000", "bowl-0001"]
    several = surfsup("simulate", out, "-o", tmp_path / "water")
    assert several.returncode == 2
    assert "holds 2 shapes; choose one by its name, as in --shape bowl-0000" in several.stderr


def test_an_interrupted_fit_keeps_its_checkpoint_and_can_be_resumed(ball, tmp_path):
    out = tmp_path / "ball.safetensors"
    long = [*SMALL, "steps=100000", "validate_every=10"]
    command = [sys.executable, "-m", "surfsup.cli", "fit", "siren", str(ball), "-o", str(out), *long]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert any("step 10:" in line for line in process.stderr)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 130, errors
    assert "finished work is kept" in errors
    assert out.is_file()
    resumed = surfsup("fit", "siren", ball, "-o", out, *long, "--resume", "--time", "1s")
    assert resumed.returncode == 0, resumed.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("siren", "points.xyz", "-o", "a.safetensors"), "have no normals"),
        (("siren", "points.xyz", "-o", "a.safetensors", "widht=3"), "did you mean 'width'"),
        (("deepsdf", ".", "-o", "a.safetensors", "--up", "y"), "none of the 1 shapes can be used"),
    ],
)
def test_bad_input_prints_one_line_and_exits_with_status_2(tmp_path, arguments, message):
    (tmp_path / "points.xyz").write_text("0 0 0\n" * 200)
    if arguments[0] == "deepsdf":
        (tmp_path / "sheet.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.1\nf 1 2 3\nf 2 4 3\n")
    done = surfsup("fit", *arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "a.safetensors").exists()


def test_every_verb_has_an_example():
    for verb in ("siren", "deepsdf", "code", "between"):
        done = surfsup("fit", verb, "--help")
        assert "Example: surfsup fit" in done.stdout
