import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from surfsup.datasets.folder import locked
from surfsup.datasets.generation.generate import generate
from surfsup.datasets.generation.record import Made
from surfsup.datasets.generation.scene_sampler import Drawing
from surfsup.errors import InputError, SimulationError
from surfsup.io.trajectory import Trajectory
from surfsup.splishsplash.solver import NAME
from tests.datasets.conftest import needs_solver

pytestmark = pytest.mark.usefixtures("tiny_recipes")


@needs_solver
def test_a_data_set_is_one_trajectory_a_scene_and_says_what_it_is(tmp_path):
    told = []
    folder = tmp_path / "new" / "data"
    paths = generate("tiny", folder, 3, seed=5, progress=lambda done, count, left: told.append((done, count)))
    assert [path.name for path in paths] == ["00000.h5", "00001.h5", "00002.h5"]
    assert {path.name for path in folder.iterdir()} == {".lock", "dataset.yaml", *(path.name for path in paths)}
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]
    said = yaml.safe_load((folder / "dataset.yaml").read_text())
    assert (said["recipe"], said["seed"], said["versions"]["solver"]) == ("tiny", 5, [NAME])
    assert (said["scenes"], said["frames_in_all"], said["set_aside"]) == (3, 18, [])
    assert said["particles"] == {"fewest": 8, "most": 8, "in_all": 24}
    assert said["statistics"]["samples"] == 3 * 5 * 8
    for index, path in enumerate(paths):
        with Trajectory(path) as trajectory:
            assert len(trajectory) == 6
            assert trajectory.scene.to_yaml() == Drawing("tiny", 5).scene(index).to_yaml()
            assert trajectory.provenance.simulator == NAME
            assert trajectory.provenance.seed == 5


@needs_solver
def test_what_is_there_is_kept_and_what_is_missing_is_made_again_to_the_byte(tmp_path):
    paths = generate("tiny", tmp_path, 3, seed=5, workers=1)
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in paths}
    description = (tmp_path / "dataset.yaml").read_text()
    paths[1].unlink()
    generate("tiny", tmp_path, 3, seed=5, workers=2)
    assert {path: path.read_bytes() for path in paths} == {path: data for path, (data, _) in before.items()}
    assert [path.stat().st_mtime_ns == before[path][1] for path in paths] == [True, False, True]
    assert (tmp_path / "dataset.yaml").read_text() == description


@needs_solver
def test_more_scenes_can_be_added_later_and_fewer_asked_for_lose_none(tmp_path):
    generate("tiny", tmp_path, 1, seed=5)
    told = []
    generate("tiny", tmp_path, 2, seed=5, progress=lambda *progress: told.append(progress[:2]))
    assert told == [(1, 2), (2, 2)]
    assert len(generate("tiny", tmp_path, 1, seed=5)) == 1
    assert yaml.safe_load((tmp_path / "dataset.yaml").read_text())["scenes"] == 2


@needs_solver
def test_the_number_of_frames_can_be_asked_for_and_then_stays(tmp_path):
    (path,) = generate("tiny", tmp_path, 1, frames=3)
    with Trajectory(path) as trajectory:
        assert len(trajectory) == 3
    assert yaml.safe_load((tmp_path / "dataset.yaml").read_text())["frames"] == 3
    with pytest.raises(InputError, match=r"holds recipe 'tiny' of seed 0, 3 frames; take another folder for"):
        generate("tiny", tmp_path, 1)


@needs_solver
def test_a_scene_that_is_not_physical_is_replaced_by_the_next_and_its_reason_kept(tmp_path):
    def gravity(seed: int, attempt: int) -> float:
        return Drawing("mixed", seed).scene(0, attempt).gravity[2]

    seed = next(seed for seed in range(100) if [gravity(seed, attempt) for attempt in range(3)] == [-1e6, -1e6, -9.81])
    (path,) = generate("mixed", tmp_path, 1, seed=seed)
    with Trajectory(path) as trajectory:
        assert trajectory.scene.to_yaml() == Drawing("mixed", seed).scene(0, attempt=2).to_yaml()
    assert Made.read(path).set_aside == ["a particle left the container"] * 2
    assert yaml.safe_load((tmp_path / "dataset.yaml").read_text())["set_aside"] == [
        {"scene": 0, "attempt": attempt, "reason": "a particle left the container"} for attempt in range(2)
    ]
    assert (tmp_path / "aside").read_text().split() == ["-1000000.0"] * 2
    assert not list(tmp_path.glob(".*.partial"))


@needs_solver
def test_an_index_without_any_sound_scene_is_an_error_and_the_others_are_made(tmp_path):
    with pytest.raises(SimulationError, match="scene 1: 5 in a row were set aside, the last because a particle left"):
        seed = next(
            seed
            for seed in range(1000)
            if all(Drawing("mixed", seed).scene(1, attempt).gravity[2] == -1e6 for attempt in range(5))
            and Drawing("mixed", seed).scene(0).gravity[2] == -9.81
        )
        generate("mixed", tmp_path, 2, seed=seed)
    assert [path.name for path in tmp_path.glob("*.h5")] == ["00000.h5"]
    assert yaml.safe_load((tmp_path / "dataset.yaml").read_text())["scenes"] == 1


@needs_solver
def test_an_interrupt_leaves_only_whole_trajectories(tmp_path):
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
def undisturbed(tmp_path_factory):
    """Scenes of a recipe that other processes know too."""
    folder = tmp_path_factory.mktemp("undisturbed")
    generate("prim-shapes", folder, 4, seed=9, frames=4)
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != ".lock"}


def surfsup_generate(folder, *options):
    command = [sys.executable, "-m", "surfsup.cli", "generate", "prim-shapes", "-o", folder, "--seed", "9", *options]
    return subprocess.Popen([*map(str, command), "-n", "4", "--frames", "4"], stderr=subprocess.PIPE, text=True)


@needs_solver
def test_killed_at_any_moment_and_started_again_it_gives_the_same_bytes(tmp_path, undisturbed):
    def work_in_progress() -> list[str]:
        return [name for name in os.listdir(tmp_path) if name.endswith((".h5", ".partial"))]

    killed = 0
    while True:
        running = surfsup_generate(tmp_path)
        seen = set(work_in_progress())
        # Killed as soon as something new is being written: in the middle of a file.
        while running.poll() is None and (killed == 2 or set(work_in_progress()) <= seen):
            time.sleep(0.005)
        running.kill()
        _, said = running.communicate()
        if running.returncode != -signal.SIGKILL:
            break
        killed += 1
    assert (running.returncode, killed) == (0, 2), said
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.name != ".lock"} == undisturbed


def start_dask(role: str, *options: str) -> subprocess.Popen:
    """A scheduler or a worker as a process, which is how a user's cluster has them."""
    command = [sys.executable, "-m", f"distributed.cli.dask_{role}", "--no-dashboard", *options]
    return subprocess.Popen(command, stderr=subprocess.DEVNULL)


@dataclass
class Cluster:
    """A real scheduler, and workers that can be killed."""

    address: str
    folder: Path
    workers: list[subprocess.Popen]

    def add_worker(self) -> None:
        own = ["--no-nanny", "--nthreads", "1", "--local-directory", str(self.folder)]
        self.workers.append(start_dask("worker", self.address, *own))


@pytest.fixture
def cluster(tmp_path_factory):
    from distributed import Client

    folder = tmp_path_factory.mktemp("dask")
    told = folder / "scheduler.json"
    scheduler = start_dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(told))
    workers = []
    try:
        deadline = time.monotonic() + 60
        while not told.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        running = Cluster(yaml.safe_load(told.read_text())["address"], folder, workers)
        running.add_worker()
        running.add_worker()
        with Client(running.address) as client:
            client.wait_for_workers(2, timeout=60)
        yield running
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


@needs_solver
def test_workers_of_a_real_cluster_are_killed_and_others_do_their_work(tmp_path, undisturbed, cluster):
    data = tmp_path / "data"
    running = surfsup_generate(data, "--scheduler", cluster.address)

    def at_work() -> int:
        return len(list(data.glob(".*.partial")))

    while running.poll() is None and at_work() < 2:
        time.sleep(0.01)
    cluster.workers[0].kill()
    lost = r"surfsup: warning: worker tcp://127.0.0.1:\d+ was lost, others do its work; "
    assert re.match(lost + "1 left$", running.stderr.readline())
    while running.poll() is None and not list(data.glob("*.h5")):
        time.sleep(0.01)
    cluster.workers[1].kill()
    assert re.match(lost + "none left, waiting for new ones$", running.stderr.readline())
    cluster.add_worker()
    _, said = running.communicate()
    assert running.returncode == 0, said
    assert [line.startswith("simulating 4 scenes") for line in said.splitlines()] == [True]
    assert {path.name: path.read_bytes() for path in data.iterdir() if path.name != ".lock"} == undisturbed


def test_a_second_run_on_the_same_folder_is_refused(tmp_path):
    with locked(tmp_path), pytest.raises(InputError, match="another run is writing into it"):
        generate("tiny", tmp_path, 1)


def test_a_folder_of_another_recipe_seed_or_source_is_refused(tmp_path):
    (tmp_path / "dataset.yaml").write_text("recipe: prim-shapes\nseed: 5\n")
    for recipe, seed, source in (("tiny", 5, None), ("prim-shapes", 6, None), ("prim-shapes", 5, tmp_path)):
        with pytest.raises(InputError, match="holds recipe 'prim-shapes' of seed 5; take another folder"):
            generate(recipe, tmp_path, 1, seed=seed, source=source)


@pytest.mark.parametrize("text", ["", "just words", "recipe: [", "- 1"])
def test_a_folder_that_does_not_say_what_it_holds_is_refused(tmp_path, text):
    (tmp_path / "dataset.yaml").write_text(text)
    with pytest.raises(InputError) as error:
        generate("tiny", tmp_path, 1)
    assert "\n" not in str(error.value)


@needs_solver
def test_a_file_of_another_data_set_is_named(tmp_path):
    (foreign,) = generate("tiny", tmp_path / "a", 1, seed=1)
    for name, complaint in [
        ("00000.h5", "is scene 0 of recipe 'tiny', seed 1"),
        ("mine.h5", "is not of this data set"),
    ]:
        folder = tmp_path / name
        folder.mkdir()
        (folder / name).write_bytes(foreign.read_bytes())
        with pytest.raises(InputError, match=complaint) as error:
            generate("tiny", folder, 1, seed=2)
        assert str(folder / name) in str(error.value)
        assert "\n" not in str(error.value)


@needs_solver
def test_a_file_that_was_cut_off_is_named(tmp_path):
    (path,) = generate("tiny", tmp_path, 1)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(InputError, match=r"00000\.h5: was cut off") as error:
        generate("tiny", tmp_path, 1)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"count": 0}, "asked for 0 scenes"),
        ({"count": -1}, "asked for -1 scenes"),
        ({"workers": 0}, "asked for 0 workers"),
        ({"recipe": "nothing"}, "there is no recipe 'nothing'; known are prim-shapes"),
        ({"seed": -1}, "seed is -1"),
        ({"frames": 0}, "frames is 0"),
        ({"source": "nowhere"}, "leave out --source"),
        ({"workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "give only one of them"),
        ({"scheduler": "tcp://127.0.0.1:1"}, "no dask scheduler answers at tcp://127.0.0.1:1"),
        ({"scheduler": "the big one"}, "is not the address of a dask scheduler"),
    ],
)
def test_what_cannot_be_made_is_refused_in_one_line_and_leaves_nothing(tmp_path, changes, complaint):
    arguments = {"recipe": "tiny", "folder": tmp_path / "data", "count": 1, **changes}
    if "source" in changes:
        arguments["source"] = tmp_path / changes["source"]
    with pytest.raises(InputError, match=complaint) as error:
        generate(**arguments)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "data").exists()
