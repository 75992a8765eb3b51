import os
import re
import signal
import subprocess
import sys
import time

import h5py
import pytest
import yaml

from surfsup.datasets.folder import lock_folder
from surfsup.datasets.generation.generate import generate
from surfsup.datasets.generation.record import GenerationRecord
from surfsup.datasets.generation.scene_sampler import SceneSampler
from surfsup.errors import InputError, SimulationError
from surfsup.io.trajectory import Trajectory
from surfsup.splishsplash.solver import NAME
from tests.dask_cluster import cluster  # noqa: F401
from tests.datasets.conftest import needs_solver

pytestmark = pytest.mark.usefixtures("tiny_recipes")


@needs_solver
def test_a_data_set_is_one_trajectory_for_each_scene_and_a_description(tmp_path):
    reports = []
    folder = tmp_path / "new" / "data"
    paths = generate("tiny", folder, 3, seed=5, progress=lambda done, count, left: reports.append((done, count)))
    assert [path.name for path in paths] == ["00000.h5", "00001.h5", "00002.h5"]
    assert {path.name for path in folder.iterdir()} == {"dataset.yaml", *(path.name for path in paths)}
    assert reports == [(0, 3), (1, 3), (2, 3), (3, 3)]
    description = yaml.safe_load((folder / "dataset.yaml").read_text())
    assert (description["recipe"], description["seed"], description["versions"]["solver"]) == ("tiny", 5, [NAME])
    assert (description["scenes"], description["frames_in_all"], description["rejected"]) == (3, 18, [])
    assert description["particles"] == {"fewest": 8, "most": 8, "in_all": 24}
    assert description["statistics"]["samples"] == 3 * 5 * 8
    for index, path in enumerate(paths):
        with Trajectory(path) as trajectory:
            assert len(trajectory) == 6
            assert trajectory.scene.to_yaml() == SceneSampler("tiny", 5).scene(index).to_yaml()
            assert trajectory.provenance.simulator == NAME
            assert trajectory.provenance.seed == 5


@needs_solver
def test_existing_scenes_are_kept_and_missing_ones_made_again_to_the_byte(tmp_path):
    paths = generate("tiny", tmp_path, 3, seed=5, workers=1)
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in paths}
    description = (tmp_path / "dataset.yaml").read_text()
    paths[1].unlink()
    generate("tiny", tmp_path, 3, seed=5, workers=2)
    assert {path: path.read_bytes() for path in paths} == {path: data for path, (data, _) in before.items()}
    assert [path.stat().st_mtime_ns == before[path][1] for path in paths] == [True, False, True]
    assert (tmp_path / "dataset.yaml").read_text() == description


@needs_solver
def test_a_larger_count_adds_scenes_and_a_smaller_one_keeps_all(tmp_path):
    generate("tiny", tmp_path, 1, seed=5)
    reports = []
    generate("tiny", tmp_path, 2, seed=5, progress=lambda *progress: reports.append(progress[:2]))
    assert reports == [(1, 2), (2, 2)]
    assert len(generate("tiny", tmp_path, 1, seed=5)) == 1
    assert yaml.safe_load((tmp_path / "dataset.yaml").read_text())["scenes"] == 2


@needs_solver
def test_the_number_of_frames_is_part_of_the_identity(tmp_path):
    (path,) = generate("tiny", tmp_path, 1, frames=3)
    with Trajectory(path) as trajectory:
        assert len(trajectory) == 3
    assert yaml.safe_load((tmp_path / "dataset.yaml").read_text())["frames"] == 3
    with pytest.raises(InputError, match=r"holds scenes of 3 frames; give --frames 3, or take another folder"):
        generate("tiny", tmp_path, 1)


@needs_solver
def test_an_unphysical_scene_is_replaced_by_the_next_draw_and_its_reason_recorded(tmp_path):
    def gravity(seed: int, attempt: int) -> float:
        return SceneSampler("mixed", seed).scene(0, attempt).gravity[2]

    seed = next(seed for seed in range(100) if [gravity(seed, attempt) for attempt in range(3)] == [-1e4, -1e4, -9.81])
    (path,) = generate("mixed", tmp_path, 1, seed=seed)
    with Trajectory(path) as trajectory:
        assert trajectory.scene.to_yaml() == SceneSampler("mixed", seed).scene(0, attempt=2).to_yaml()
    reasons = GenerationRecord.read(path).rejections
    assert [re.match("a particle (left the container|flew at 50 m/s)", reason) is not None for reason in reasons] == [
        True
    ] * 2
    assert yaml.safe_load((tmp_path / "dataset.yaml").read_text())["rejected"] == [
        {"scene": 0, "attempt": attempt, "reason": reason} for attempt, reason in enumerate(reasons)
    ]
    assert (tmp_path / "discarded").read_text().split() == ["-10000.0"] * 2
    assert not list(tmp_path.glob(".*.partial"))


@needs_solver
def test_an_index_without_a_valid_scene_is_an_error_and_the_other_scenes_are_made(tmp_path):
    with pytest.raises(
        SimulationError, match=r"scene 1: 5 in a row were rejected, the last because a particle (left|flew)"
    ):
        seed = next(
            seed
            for seed in range(1000)
            if all(SceneSampler("mixed", seed).scene(1, attempt).gravity[2] == -1e4 for attempt in range(5))
            and SceneSampler("mixed", seed).scene(0).gravity[2] == -9.81
        )
        generate("mixed", tmp_path, 2, seed=seed)
    assert [path.name for path in tmp_path.glob("*.h5")] == ["00000.h5"]
    assert yaml.safe_load((tmp_path / "dataset.yaml").read_text())["scenes"] == 1


@needs_solver
def test_the_record_has_the_attributes_of_version_0_1(tmp_path):
    (path,) = generate("tiny", tmp_path, 1)
    with h5py.File(path) as file:
        assert {"recipe", "seed", "index", "set_aside", "samples"} <= set(file["data_set"].attrs)


@needs_solver
def test_an_interrupt_leaves_only_complete_trajectories(tmp_path):
    def interrupt(done: int, count: int, left: float | None) -> None:
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate("tiny", tmp_path, 6, seed=5, workers=1, progress=interrupt)
    made = sorted(tmp_path.glob("*.h5"))
    assert 1 <= len(made) < 6
    for path in made:
        with Trajectory(path) as trajectory:
            assert len(trajectory) == 6
    assert len(generate("tiny", tmp_path, 6, seed=5)) == 6


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """The files of a data set whose recipe exists in other processes too."""
    folder = tmp_path_factory.mktemp("uninterrupted")
    generate("prim-shapes", folder, 4, seed=9, frames=4)
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != ".lock"}


def surfsup_generate(folder, *options):
    command = [sys.executable, "-m", "surfsup.cli", "generate", "prim-shapes", "-o", folder, "--seed", "9", *options]
    return subprocess.Popen([*map(str, command), "-n", "4", "--frames", "4"], stderr=subprocess.PIPE, text=True)


@needs_solver
def test_after_a_kill_at_any_moment_a_second_run_gives_the_same_bytes(tmp_path, uninterrupted):
    def work_in_progress() -> list[str]:
        return [name for name in os.listdir(tmp_path) if name.endswith((".h5", ".partial"))]

    killed = 0
    while True:
        running = surfsup_generate(tmp_path)
        before = set(work_in_progress())
        # Kill the run while it writes a new file.
        while running.poll() is None and (killed == 2 or set(work_in_progress()) <= before):
            time.sleep(0.005)
        running.kill()
        _, output = running.communicate()
        if running.returncode != -signal.SIGKILL:
            break
        killed += 1
    assert (running.returncode, killed) == (0, 2), output
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.name != ".lock"} == uninterrupted


def next_warning(lines):
    """The next line that does not report progress."""
    return next(line for line in lines if not line.startswith("simulating "))


@needs_solver
def test_other_workers_repeat_the_work_of_killed_ones(tmp_path, uninterrupted, cluster):  # noqa: F811
    data = tmp_path / "data"
    running = surfsup_generate(data, "--scheduler", cluster.address)

    def running_jobs() -> int:
        return len(list(data.glob(".*.partial")))

    while running.poll() is None and running_jobs() < 2:
        time.sleep(0.01)
    cluster.workers[0].kill()
    lost = r"surfsup: warning: worker tcp://127.0.0.1:\d+ was lost, others do its work; "
    assert re.match(lost + "1 left$", next_warning(running.stderr))
    while running.poll() is None and not list(data.glob("*.h5")):
        time.sleep(0.01)
    cluster.workers[1].kill()
    assert re.match(lost + "none left, waiting for new ones$", next_warning(running.stderr))
    cluster.add_worker()
    _, output = running.communicate()
    assert running.returncode == 0, output
    assert {line.partition(":")[0] for line in output.splitlines()} == {"simulating 4 scenes of prim-shapes"}
    assert {path.name: path.read_bytes() for path in data.iterdir() if path.name != ".lock"} == uninterrupted


def test_a_second_run_in_the_same_folder_is_an_error(tmp_path):
    with lock_folder(tmp_path), pytest.raises(InputError, match="another run is writing into it"):
        generate("tiny", tmp_path, 1)


def test_a_folder_of_another_recipe_seed_or_source_is_an_error(tmp_path):
    (tmp_path / "dataset.yaml").write_text("recipe: prim-shapes\nseed: 5\n")
    for recipe, seed, source in (("tiny", 5, None), ("prim-shapes", 6, None), ("prim-shapes", 5, tmp_path)):
        with pytest.raises(InputError, match="holds recipe 'prim-shapes' of seed 5; take another folder"):
            generate(recipe, tmp_path, 1, seed=seed, source=source)


@pytest.mark.parametrize("text", ["", "just words", "recipe: [", "- 1"])
def test_a_folder_without_an_identity_is_an_error(tmp_path, text):
    (tmp_path / "dataset.yaml").write_text(text)
    with pytest.raises(InputError) as error:
        generate("tiny", tmp_path, 1)
    assert "\n" not in str(error.value)


@needs_solver
def test_a_file_of_another_data_set_is_named(tmp_path):
    (other,) = generate("tiny", tmp_path / "a", 1, seed=1)
    for name, message in [
        ("00000.h5", "is scene 0 of recipe 'tiny', seed 1"),
        ("mine.h5", "is not of this data set"),
    ]:
        folder = tmp_path / name
        folder.mkdir()
        (folder / name).write_bytes(other.read_bytes())
        with pytest.raises(InputError, match=message) as error:
            generate("tiny", folder, 1, seed=2)
        assert str(folder / name) in str(error.value)
        assert "\n" not in str(error.value)


@needs_solver
def test_a_truncated_file_is_named(tmp_path):
    (path,) = generate("tiny", tmp_path, 1)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(InputError, match=r"00000\.h5: was cut off") as error:
        generate("tiny", tmp_path, 1)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 0}, "the number of scenes is 0"),
        ({"count": -1}, "the number of scenes is -1"),
        ({"workers": 0}, "the number of workers is 0"),
        ({"recipe": "nothing"}, "there is no recipe 'nothing'; known are prim-shapes"),
        ({"seed": -1}, "seed is -1"),
        ({"frames": 0}, "frames is 0"),
        ({"source": "nowhere"}, "nowhere: does not exist"),
        ({"source": "."}, "leave out --source"),
        ({"workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "give only one of them"),
        ({"scheduler": "tcp://127.0.0.1:1"}, "no dask scheduler answers at tcp://127.0.0.1:1"),
        ({"scheduler": "the big one"}, "is not the address of a dask scheduler"),
    ],
)
def test_invalid_arguments_are_an_error_of_one_line_and_leave_no_files(tmp_path, changes, message):
    arguments = {"recipe": "tiny", "folder": tmp_path / "data", "count": 1, **changes}
    if "source" in changes:
        arguments["source"] = tmp_path / changes["source"]
    with pytest.raises(InputError, match=message) as error:
        generate(**arguments)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero"), lambda path: path.mkdir()])
@pytest.mark.parametrize("name", ["dataset.yaml", "00000.h5"])
def test_what_is_no_plain_file_in_a_stranger_s_data_set_is_refused(tmp_path, make, name):
    """None of it is read: a pipe would wait without end, a device has no end."""
    make(tmp_path / name)
    with pytest.raises(InputError, match=f"{re.escape(name)}: is no plain file"):
        generate("tiny", tmp_path, 1)


def test_a_description_without_end_is_refused_before_it_is_read(tmp_path):
    with (tmp_path / "dataset.yaml").open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(InputError, match="too large"):
        generate("tiny", tmp_path, 1)


@needs_solver
def test_a_record_that_is_elsewhere_or_no_number_is_refused(tmp_path):
    paths = generate("tiny", tmp_path, 2)
    with h5py.File(paths[0], "r+") as file:
        file["data_set"].attrs["velocity_sum"] = [float("nan"), 0.0, 0.0]
    with pytest.raises(InputError, match=r"00000\.h5.*not three finite numbers"):
        generate("tiny", tmp_path, 2)
    with h5py.File(paths[0], "r+") as file:
        del file["data_set"]
        file["data_set"] = h5py.ExternalLink("00001.h5", "data_set")
    with pytest.raises(InputError, match=r"00000\.h5.*is a link to another place"):
        generate("tiny", tmp_path, 2)
