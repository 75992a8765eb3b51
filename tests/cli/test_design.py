import json
import subprocess
import sys

import pytest

from surfsup.cli import main


def run(monkeypatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["surfsup", "design", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


SHORT = ("--iterations", 1, "--frames", 20, "--no-verification", "--no-video")


def test_writes_shapes_plot_and_history(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("surfsup.design.shape_files.RESOLUTION", 48)
    assert run(monkeypatch, "bowl", "-o", tmp_path / "bowl", "--start", "0.15,0.02", *SHORT) == 0
    written = {path.name for path in (tmp_path / "bowl").iterdir()}
    assert {"best.stl", "best.glb", "best.obj", "history.png", "history.csv", "design.json"} <= written
    assert "bowl: reward" in capsys.readouterr().out
    assert json.loads((tmp_path / "bowl" / "design.json").read_text())["designs"]["start"]["r1"] == pytest.approx(0.15)

    assert run(monkeypatch, "bowl", "-o", tmp_path / "bowl", "--start", "0.15,0.02", *SHORT) == 2
    assert "contains a design already; use --resume" in capsys.readouterr().err
    assert run(monkeypatch, "bowl", "-o", tmp_path / "bowl", "--start", "0.15,0.02", *SHORT, "--resume") == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("bucket",), "there is no design 'bucket'"),
        (("bowl", "--start", "0.5,0"), "the start of r1 is 0.5, outside its bounds"),
        (("bowl", "--start", "wide"), "give two radii in meters"),
        (("latent",), "choose one by its name"),
        (("latent", "--deepsdf", "none.safetensors"), "none.safetensors"),
        (("funnel", "--frames", "5"), "no particle reached the floor"),
    ],
)
def test_bad_input_is_refused_in_one_line_with_status_2(monkeypatch, tmp_path, capsys, arguments, message):
    assert run(monkeypatch, *arguments, "-o", tmp_path / "out", "--no-verification", "--no-video") == 2
    error = capsys.readouterr().err.strip()
    assert message in error and len(error.splitlines()) == 1


def test_a_signal_stops_the_run_and_keeps_its_checkpoint(tmp_path):
    import signal
    import time

    endless = ("--start", "0.15,0.02", "--frames", 40, "--iterations", 10**6, "--no-verification", "--no-video")
    command = [sys.executable, "-m", "surfsup.cli", "design", "bowl", "-o", tmp_path, *endless]
    process = subprocess.Popen([*map(str, command)], stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not (tmp_path / "history.csv").exists() and time.monotonic() < deadline:
        time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130 and "finished work is kept" in errors
    assert (tmp_path / "checkpoint.safetensors").exists()
