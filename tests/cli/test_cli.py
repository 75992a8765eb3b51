"""The program as users run it: in a process of its own, by its output files and its exit status."""

import json
import os
import signal
import subprocess
import sys
import time
from importlib.resources import files

import av
import h5py
import numpy as np
import pytest
import torch
import trimesh
from safetensors.torch import save_file

from surfsup import __version__
from surfsup.cli.generate import RECIPE_NAMES
from surfsup.cli.train import PRESET_NAMES
from surfsup.datasets.recipes import RECIPES
from surfsup.io.trajectory import Trajectory
from surfsup.learned import weights_file
from surfsup.learned.training_domain import TrainingDomain
from surfsup.scene import Scene
from tests.evaluation.scenes import SCENE as FALL
from tests.evaluation.scenes import free_fall, write

SCENE = """
surface: {sphere: {radius: 0.2}, at: [0, 0, 0.2]}
fluid:
  - block: {min: [-0.15, -0.15, 0.45], max: [0.15, 0.15, 0.6]}
frames: 30
"""


def surfsup(*arguments, **options):
    command = [sys.executable, "-m", "surfsup.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, **options)


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


def test_water_on_a_mesh_leaves_trajectory_page_video_and_summary(tmp_path):
    mesh = tmp_path / "ball.stl"
    trimesh.creation.icosphere(3, 25.0).export(mesh)
    out = tmp_path / "out"
    done = surfsup(
        "simulate", mesh, "-o", out, "--frames", 30, "--block-min", -0.1, -0.1, 0.8, "--block-max", 0.1, 0.1, 1.0
    )
    assert done.returncode == 0, done.stderr
    assert "50 x 50 x 50" in done.stderr
    for name in ("trajectory.h5", "page.html", "video.mp4"):
        assert name in done.stdout
        assert (out / name).stat().st_size > 1000
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["frames"], summary["penetrations"], summary["out_of_container"]) == (30, 0, 0)
    with Trajectory(out / "trajectory.h5") as trajectory:
        assert trajectory.positions.shape == (30, summary["particles"], 3)
        assert np.isfinite(trajectory.positions[:]).all()
        assert trajectory.positions[-1][:, 2].mean() < trajectory.positions[0][:, 2].mean() - 0.05
    with av.open(str(out / "video.mp4")) as video:
        assert sum(1 for _ in video.decode(video=0)) > 1


def test_simulator_and_reference_start_alike_and_agree_in_free_fall(scene, tmp_path):
    for verb in ("simulate", "reference"):
        done = surfsup(verb, scene, "-o", tmp_path / verb, "--no-page", "--no-video", "--frames", 4)
        assert done.returncode == 0, done.stderr
    with Trajectory(tmp_path / "simulate/trajectory.h5") as a, Trajectory(tmp_path / "reference/trajectory.h5") as b:
        np.testing.assert_allclose(a.positions[0], b.positions[0], atol=1e-6)
        np.testing.assert_allclose(a.positions[-1], b.positions[-1], atol=2e-3)


def test_page_and_pictures_can_be_made_later(scene, tmp_path):
    out = tmp_path / "out"
    surfsup("simulate", scene, "-o", out, "--no-page", "--no-video", "--frames", 3)
    assert not (out / "page.html").exists()
    assert surfsup("view", out / "trajectory.h5").returncode == 0
    assert (out / "page.html").exists()
    assert surfsup("render", out / "trajectory.h5", "--frame", 2).returncode == 0
    assert (out / "frame-00002.png").read_bytes().startswith(b"\x89PNG")
    refused = surfsup("render", out / "trajectory.h5", "--frame", 3)
    assert (refused.returncode, "has the frames 0 to 2" in refused.stderr) == (2, True)
    assert surfsup("view", out / "trajectory.h5", "-o", tmp_path / "elsewhere.html").returncode == 0
    assert (tmp_path / "elsewhere.html").stat().st_size == (out / "page.html").stat().st_size
    for name, fault in (("page.mp4", "does not end in .html"), ("missing/page.html", "there is no folder")):
        refused = surfsup("view", out / "trajectory.h5", "-o", tmp_path / name)
        assert (refused.returncode, fault in " ".join(refused.stderr.split())) == (2, True)
    options = ("--every", 1, "--fps", 60, "--size", "128x96", "--camera", "-90,10,1.5", "--turntable")
    done = surfsup("render", out / "trajectory.h5", *options)
    assert done.returncode == 0, done.stderr
    with av.open(str(out / "video.mp4")) as video:
        stream = video.streams.video[0]
        assert (stream.width, stream.height, stream.average_rate) == (128, 96, 60)
        assert sum(1 for _ in video.decode(stream)) == 3


def test_an_evaluation_writes_a_report_and_its_rollout_can_be_compared_again(tmp_path):
    truth = write(tmp_path / "falls/00000.h5", *free_fall())
    (tmp_path / "falls/broken.h5").write_text("not HDF5")
    done = surfsup("evaluate", "dfsph", tmp_path / "falls", "-o", tmp_path / "report", "--no-video")
    assert done.returncode == 0, done.stderr
    assert "no floor (make it with 'surfsup floor" in done.stdout
    assert "1 skipped" in done.stdout
    assert sorted(os.listdir(tmp_path / "report")) == ["report.html", "report.json", "trajectories"]
    rollout = tmp_path / "report/trajectories/falls/00000.h5"
    compared = surfsup("compare", rollout, truth, "-o", tmp_path / "new/pair.json")
    assert compared.returncode == 0, compared.stderr
    report, pair = (json.loads((tmp_path / name).read_text()) for name in ("report/report.json", "new/pair.json"))
    assert pair["windows"] == report["scenes"][0]["windows"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulat"], "Did you mean 'simulate'"),
        (["simulate"], "SURFACE|SCENE.yaml is missing, as in: surfsup simulate bunny.obj"),
        (["train", "surfsup"], "--validation and --out are missing, as in: surfsup train surfsup --data"),
        (["simulate", "nothing.obj"], "nothing.obj"),
        (["simulate", "SCENE", "--frames", "0"], "greater than or equal to 1"),
        (["simulate", "SCENE", "--simulator", "absent"], "there is no simulator 'absent'"),
        (["simulate", "SCENE", "--fit", "0.7"], "a scene file places everything itself; omit --fit"),
        (["simulate", "SCENE", "--no-fit"], "a scene file places everything itself; omit --no-fit"),
        (["simulate", "SCENE", "--up", "w"], "Invalid value for '--up'"),
        (["simulate", "ball.stl", "--block-min", "0", "0", "1"], "--block-min is one corner"),
        (["simulate", "ball.stl", "--container", "1", "1", "0"], "Container: size.2: Input should be greater than 0"),
        (["simulate", "SCENE", "--device", "tpu"], "there is no device 'tpu'"),
        (["simulate", "SCENE", "--up", "y"], "a scene file places everything itself; omit --up"),
        (["simulate", "SCENE", "-o", "SCENE"], "cannot be used as the output folder"),
        (["generate", "nothing", "-o", "data", "-n", "1"], "there is no recipe 'nothing'"),
        (["generate", "prim-shapes", "-o", "data", "-n", "0"], "at least 1"),
        (["train", "nothing", "--data", ".", "--validation", ".", "-o", "run"], "no training preset"),
        (["train", "sursup", "--data", ".", "--validation", ".", "-o", "run"], "did you mean 'surfsup'"),
        (["train", "surfsup", "--data", "OTHER", "--validation", ".", "-o", "run"], "0.015 m, so take other data"),
        (["evaluate", "dfsph", "OTHER", "-o", "report"], "0.015 m, so take other data"),
        (
            ["evaluate", "old.safetensors", "OTHER", "-o", "report"],
            "is weights format 'surfsup-simulator-2' of another version",
        ),
        (["compare", "OTHER/00000.h5", "STANDARD/00000.h5"], "simulate both with the same fps and particle_radius"),
        (["evaluate", "dfsph", ".", "--frames", "0"], "greater than or equal to 1"),
        (["train", "surfsup", "--data", ".", "--validation", ".", "-o", "run", "--time", "soon"], "length of time"),
        (["train", "surfsup", "width", "--data", ".", "--validation", ".", "-o", "run"], "key=value"),
        (["train", "surfsup", "widht=8", "--data", ".", "--validation", ".", "-o", "run"], "did you mean 'width'"),
        (["train", "surfsup", "--data", ".", "--validation", ".", "-o", "run"], "no trajectories"),
        (["train", "surfsup", "--validation", ".", "-o", "run"], "either --data DIR or --stream RECIPE"),
        (["train", "surfsup", "--stream", "nothing", "--validation", ".", "-o", "run"], "no recipe 'nothing'"),
        (["floor", "."], "no trajectories"),
        (["evaluate", "dfsph", ".", "-o", "report"], "no trajectories"),
        (["evaluate", "dfsph", ".", "--near", "nan"], "nan is not a length"),
        (["compare", "SCENE", "nothing.h5"], "nothing.h5: there is no such trajectory file"),
        (["compare", "nothing.h5", "SCENE"], "there is no such trajectory file"),
        (["view", "SCENE"], "not a trajectory"),
        (["export", "STANDARD", "--to", "vtk"], "STANDARD: has no trajectory.h5"),
        (["render", "FOLDER", "-o", "one.png"], "--frame writes a .png"),
    ],
)
def test_bad_input_prints_one_line_exits_with_status_2_and_writes_nothing(arguments, message, scene, tmp_path):
    trimesh.creation.icosphere(1, 0.3).export(tmp_path / "ball.stl")
    save_file({"weight": torch.zeros(1)}, tmp_path / "old.safetensors", {"format": "surfsup-simulator-2"})
    with h5py.File(write(tmp_path / "OTHER/00000.h5", *free_fall(2), scene=FALL.with_frames(2)), "r+") as file:
        file.attrs["radius"] = 0.025
    write(tmp_path / "STANDARD/00000.h5", *free_fall(2), scene=FALL.with_frames(2))
    write(tmp_path / "FOLDER/trajectory.h5", *free_fall(2), scene=FALL.with_frames(2))
    before = sorted(os.listdir(tmp_path))
    done = surfsup(*[str(scene) if argument == "SCENE" else argument for argument in arguments], cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert sorted(os.listdir(tmp_path)) == before


def test_a_scene_outside_the_training_domain_causes_a_warning(scene, tmp_path):
    simulator, card = weights_file.load(weights_file.find("surfsup"))
    domain = TrainingDomain.from_scene(Scene.load(scene), 1000, 5.0)
    model = tmp_path / "model.safetensors"
    weights_file.save(model, simulator, weights_file.Card(card.name, card.about, domain))
    wide = tmp_path / "wide.yaml"
    wide.write_text(SCENE + "container: {size: [3, 1, 2]}")
    for source, warnings in ((scene, 0), (wide, 1)):
        done = surfsup(
            "simulate", source, "--simulator", model, "-o", tmp_path / "out", "--frames", 2, "--no-page", "--no-video"
        )
        assert done.returncode == 0, done.stderr
        assert done.stderr.count("not trained for a container of 3 x 1 x 2 m") == warnings
        assert done.stderr.count("warning") == warnings


def test_without_collisions_an_evaluation_has_its_own_folder_and_unknown_data_cause_one_warning(tmp_path):
    simulator, card = weights_file.load(weights_file.find("surfsup"))
    domain = TrainingDomain.from_scene(FALL.model_copy(update={"surface": None}), 1000, 5.0)
    weights_file.save(tmp_path / "model.safetensors", simulator, weights_file.Card(card.name, card.about, domain))
    for name in ("falls/00000.h5", "falls/00001.h5", "falls/00002.h5"):
        write(tmp_path / name, *free_fall())
    done = surfsup(
        *("evaluate", "model.safetensors", "falls", "--no-collisions", "--scenes", 2, "--frames", 5, "--no-video"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert "falls: 2 scenes, no floor" in done.stdout
    assert "'surfsup' without collision handling, the first 5 frames" in done.stdout
    assert done.stderr.count("warning: falls: the weights were not trained for a surface of kind 'sphere' (2 of 2") == 1
    assert done.stderr.count("warning") == 1
    report = json.loads((tmp_path / "out/report-surfsup-no-collisions/report.json").read_text())
    assert (report["simulator"]["handle_collisions"], report["limits"]) == (False, {"scenes": 2, "frames": 5})
    assert [scene["frames"] for scene in report["scenes"]] == [5, 5]


def handle_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_leaves_a_readable_trajectory_and_status_130(scene, tmp_path, number):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "surfsup.cli", "simulate", str(scene), "-o", str(out), "--frames", "200000"]
    # Children of tests that run in the background would ignore the signal.
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=handle_interrupts) as running:
        deadline = time.monotonic() + 60
        written = 0
        # Wait for some frames, however busy the machine is.
        while written < 20_000 and running.poll() is None and time.monotonic() < deadline:
            time.sleep(0.2)
            written = (out / "trajectory.h5").stat().st_size if (out / "trajectory.h5").exists() else 0
        running.send_signal(number)
        _, errors = running.communicate(timeout=60)
    assert running.returncode == 130, errors
    with Trajectory(out / "trajectory.h5") as trajectory:
        assert len(trajectory) == json.loads((out / "summary.json").read_text())["frames"]
        assert f"interrupted; {len(trajectory)} of 200000 frames are kept in {out / 'trajectory.h5'}" in errors


def test_an_interrupt_before_the_first_frame_says_so(scene, tmp_path):
    script = (
        "import sys, surfsup.sph.device as device\n"
        "def interrupt(name): raise KeyboardInterrupt\n"
        "device.choose_device = interrupt\n"
        "from surfsup.cli.program import main\n"
        "main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, "simulate", str(scene)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (130, "surfsup: interrupted; nothing was finished yet\n")


@pytest.mark.parametrize("corner", ["-0.15,-0.15,0.45", "-0.15 -0.15 0.45"])
def test_a_vector_is_three_words_or_one_with_commas(corner, tmp_path):
    ball = tmp_path / "ball.ply"
    trimesh.creation.icosphere(2, 0.2).export(ball)
    block = ("--block-min", *corner.split(), "--block-max=0.15,0.15,0.6")
    done = surfsup(
        "simulate", ball, "--fit", 0.3, *block, "--frames", 2, "-o", tmp_path / "out", "--no-page", "--no-video"
    )
    assert done.returncode == 0, done.stderr
    with Trajectory(tmp_path / "out" / "trajectory.h5") as trajectory:
        (water,) = trajectory.scene.fluid
    assert (water.block.min, water.block.max) == ((-0.15, -0.15, 0.45), (0.15, 0.15, 0.6))


def test_a_vector_of_two_numbers_is_refused(tmp_path):
    done = surfsup("simulate", "ball.ply", "--at", "0,1")
    assert done.returncode == 2
    assert "'--at' requires 3 arguments" in done.stderr


def test_the_help_names_every_recipe_and_preset():
    assert set(RECIPE_NAMES) == set(RECIPES)
    presets = files("surfsup.training") / "presets"
    assert {f"{name}.yaml" for name in PRESET_NAMES} == {entry.name for entry in presets.iterdir()}


def test_without_graphics_the_error_names_the_package_and_no_video_works(scene, tmp_path):
    """Simulates a machine without libEGL, which the loader does not find."""
    script = (
        "import ctypes, sys\n"
        "real = ctypes.CDLL\n"
        "def without_egl(name, *rest, **more):\n"
        "    if name and 'EGL' in str(name):\n"
        "        raise OSError(name)\n"
        "    return real(name, *rest, **more)\n"
        "ctypes.CDLL = without_egl\n"
        "from surfsup.cli import main\n"
        "main()\n"
    )
    base = [sys.executable, "-c", script, "simulate", str(scene), "--frames", "2"]
    refused = subprocess.run([*base, "-o", str(tmp_path / "a")], capture_output=True, text=True, check=False)
    assert (refused.returncode, "libegl1" in refused.stderr) == (2, True)
    assert not (tmp_path / "a").exists()
    made = subprocess.run([*base, "-o", str(tmp_path / "b"), "--no-video"], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr


def test_version_works_and_every_verb_has_an_example():
    assert surfsup("--version").stdout.strip() == __version__
    verbs = "simulate reference generate floor train evaluate compare design view render doctor"
    for verb in verbs.split():
        assert f"surfsup {verb}" in surfsup(verb, "--help").stdout


def test_help_and_version_import_nothing_heavy():
    for option in ("--help", "--version"):
        command = [sys.executable, "-X", "importtime", "-m", "surfsup.cli", option]
        lines = subprocess.run(command, capture_output=True, text=True, check=True).stderr.splitlines()
        imported = {line.rpartition("|")[2].strip() for line in lines}
        assert "surfsup.cli.program" in imported
        assert not imported & {"numpy", "torch", "scipy", "pydantic", "trimesh", "h5py", "pyvista", "rich"}
