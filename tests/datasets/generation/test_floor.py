import numpy as np
import pytest

from surfsup.datasets.generation.floor import FloorWarning, simulate_floor
from surfsup.datasets.generation.generate import generate
from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Scene
from surfsup.splishsplash import solver
from tests.datasets.conftest import needs_solver

pytestmark = [needs_solver, pytest.mark.usefixtures("tiny_recipes")]


@pytest.fixture
def data(tmp_path):
    generate("tiny", tmp_path, 2, seed=5)
    return tmp_path


def test_each_scene_is_run_three_times_with_its_water_moved_by_1_mm(data):
    reports = []
    paths = simulate_floor(data, progress=lambda done, count, left: reports.append((done, count)))
    assert [path.name for path in paths] == [f"0000{scene}-{run}.h5" for scene in (0, 1) for run in (1, 2, 3)]
    assert reports == [(done, 6) for done in range(7)]
    for number, path in enumerate(paths):
        with Trajectory(path) as again, Trajectory(data / f"0000{number // 3}.h5") as truth:
            shift = 0.001 * np.eye(3)[number % 3]
            assert again.positions.shape == truth.positions.shape
            np.testing.assert_allclose(again.positions[0], truth.positions[0] + shift, atol=1e-6)
            # The same lattice in free fall stays 1 mm away.
            np.testing.assert_allclose(again.positions[-1], truth.positions[-1] + shift, atol=1e-5)
            block, original = again.scene.fluid[0].block, truth.scene.fluid[0].block
            np.testing.assert_allclose(np.subtract(block.min, original.min), shift, atol=1e-9)
            np.testing.assert_allclose(np.subtract(block.max, original.max), shift, atol=1e-9)
            assert again.provenance.simulator == solver.NAME


def test_fine_particles_have_the_frames_and_the_floor_of_a_larger_scene_scaled_down(data, tmp_path):
    generate("tiny-fine", tmp_path / "fine", 1, seed=5)
    simulate_floor(data)
    simulate_floor(tmp_path / "fine")
    for name in ("00000.h5", "floor/00000-1.h5"):
        with Trajectory(tmp_path / "fine" / name) as fine, Trajectory(data / name) as large:
            assert fine.frame_time == pytest.approx(large.frame_time / 2)
            np.testing.assert_allclose(fine.positions[:], large.positions[:] / 4, atol=2e-6)
            np.testing.assert_allclose(fine.velocities[:], large.velocities[:] / 2, atol=2e-4)


def test_missing_runs_are_made_again_to_the_byte_and_others_kept(data):
    paths = simulate_floor(data)
    before = {path: path.read_bytes() for path in paths}
    paths[4].unlink()
    reports = []
    simulate_floor(data, workers=1, progress=lambda done, count, left: reports.append((done, count)))
    assert reports == [(5, 6), (6, 6)]
    assert {path: path.read_bytes() for path in paths} == before


def test_a_failed_run_is_left_out_with_a_warning(data):
    scene = Scene.from_yaml(
        "container: {size: [0.4, 0.4, 0.4]}\ngravity: [0, 0, -1e4]\n"
        "fluid: [{block: {min: [0, 0, 0.1], max: [0.1, 0.1, 0.2]}}]",
        "heavy",
    )
    start = scene.initial_particles(None)
    with TrajectoryWriter(data / "00002.h5", scene, Provenance("none"), len(start.positions)) as writer:
        for _ in range(6):
            writer.append(start.positions, start.velocities)
    with pytest.warns(FloorWarning) as reports:
        paths = simulate_floor(data)
    assert len(paths) == 6
    assert len(reports) == 3
    for run, warning in enumerate(reports, start=1):
        assert str(warning.message).startswith(f"{data}/floor/00002-{run}.h5: a particle flew at ")
    failed = data / "floor" / "00002-3.failed.txt"
    assert failed.read_text().startswith("a particle flew at ")


def test_a_truncated_trajectory_is_left_out_with_a_warning(data):
    path = data / "00001.h5"
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.warns(FloorWarning, match=r"00001\.h5.*it is left out"):
        assert len(simulate_floor(data)) == 3


def test_a_floor_of_other_scenes_is_an_error(data):
    simulate_floor(data)
    (data / "00001.h5").write_bytes((data / "00000.h5").read_bytes())
    with pytest.raises(InputError, match=r"00001-1\.h5: is not 00001\.h5 run again"):
        simulate_floor(data)


def test_a_folder_without_trajectories_is_an_error(tmp_path):
    with pytest.raises(InputError, match="has no trajectories"):
        simulate_floor(tmp_path)
    assert not list(tmp_path.iterdir())


FLUID = "fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.7]}}]"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"fps: 50\n{FLUID}", r"other\.h5: has a frame every 0\.02 s"),
        (f"restart: first.h5\n{FLUID}", r"other\.h5: continues another trajectory \(restart\)"),
    ],
)
def test_scenes_that_the_floor_cannot_run_are_refused(tmp_path, text, message):
    data = tmp_path / "data"
    data.mkdir()
    zero = np.zeros((1, 3), np.float32)
    for name, scene in (("first.h5", FLUID), ("other.h5", text)):
        with TrajectoryWriter(data / name, Scene.from_yaml(scene, "test", data), Provenance("test"), 1) as writer:
            writer.append(zero, zero)
    with pytest.raises(InputError, match=message):
        simulate_floor(data)
    assert not (data / "floor").exists()
