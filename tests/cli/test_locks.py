"""A folder that another run writes to is refused before anything in it changes."""

import os
import subprocess
import sys

import pytest
import trimesh

from surfsup.cli.program import main
from surfsup.io.folder_lock import locked_folder
from tests.evaluation.scenes import SCENE, free_fall, write

SMALL = "fluid: [{block: {min: [0, 0, 1], max: [0.1, 0.1, 1.1]}}]\nframes: 9\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "scene.yaml").write_text(SMALL)
    trimesh.creation.icosphere(1, 0.3).export(tmp_path / "ball.stl")
    write(tmp_path / "data/00000.h5", *free_fall(2), scene=SCENE.with_frames(2))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "verb",
    [
        ["simulate", "scene.yaml", "-o", "out", "--no-video", "--no-page"],
        ["export", "data/00000.h5", "--to", "ply", "-o", "out"],
        ["train", "surfsup", "--data", "data", "--validation", "data", "-o", "out"],
        ["fit", "siren", "ball.stl", "-o", "out.safetensors"],
        ["design", "bowl", "-o", "out", "--no-video", "--no-verification"],
        ["evaluate", "dfsph", "data", "-o", "out", "--no-video"],
        ["generate", "prim-shapes", "-o", "out", "-n", "1"],
    ],
    ids=lambda verb: verb[0],
)
def test_a_second_run_into_a_folder_is_refused_and_changes_nothing(verb, folder, monkeypatch, capsys):
    target = folder / ("out.fit" if verb[0] == "fit" else "out")
    target.mkdir()
    (target / "trajectory.h5").write_bytes(b"of the first run")
    before = sorted(os.listdir(folder))
    monkeypatch.setattr(sys, "argv", ["surfsup", *verb])
    with locked_folder(target), pytest.raises(SystemExit) as end:
        main()
    last = capsys.readouterr().err.splitlines()[-1]
    assert end.value.code == 2
    assert last == f"surfsup: {target.resolve() if verb[0] == 'generate' else target.name}: another run is writing" + (
        " into it; wait for it or stop it"
    )
    assert (target / "trajectory.h5").read_bytes() == b"of the first run"
    assert sorted(os.listdir(folder)) == before


def test_a_full_standard_output_is_one_line_and_a_closed_one_is_silent(folder):
    command = [sys.executable, "-m", "surfsup.cli", "simulate", "scene.yaml", "-o", "out", "--no-video", "--no-page"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == "surfsup: the disk is full, or a limit is reached"
    assert "Traceback" not in done.stderr and (folder / "out" / "trajectory.h5").exists()
    reader, end = os.pipe()
    os.close(reader)
    done = subprocess.run(command, stdout=end, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    os.close(end)
    assert done.returncode == 1
    assert all(line.startswith("simulating") for line in done.stderr.splitlines())
