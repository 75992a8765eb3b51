import os
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from surfsup import __version__
from surfsup.errors import InputError, SimulationError
from surfsup.io import trajectory as module
from surfsup.io.trajectory import (
    FRAMES_PER_FLUSH,
    VELOCITY_STEP,
    Provenance,
    Trajectory,
    TrajectoryFrames,
    TrajectoryWriter,
)
from surfsup.scene import Scene
from surfsup.scene.pose import Pose
from surfsup.scene.wrench import Wrench

PARTICLES = 20
SCENE = Scene.from_yaml(
    "surface: {sphere: {radius: 0.3}, at: [0, 0, 0.3]}\nfluid: [{block: {min: [-0.1, -0.1, 1], max: [0.1, 0.1, 1.2]}}]",
    "test",
)


def frames(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random positions, and velocities that are multiples of VELOCITY_STEP."""
    positions, velocities = np.random.default_rng(seed).normal(size=(2, count, PARTICLES, 3))
    return positions.astype(np.float32), (np.round(velocities / VELOCITY_STEP) * VELOCITY_STEP).astype(np.float32)


def writer(path: Path, particles: int = PARTICLES) -> TrajectoryWriter:
    return TrajectoryWriter(path, SCENE, Provenance("a model", seed=7), particles)


def write(path: Path, count: int) -> tuple[np.ndarray, np.ndarray]:
    positions, velocities = frames(count)
    with writer(path) as out:
        for frame in zip(positions, velocities, strict=True):
            out.append(*frame)
    return positions, velocities


@pytest.mark.parametrize("count", [0, 1, 2, FRAMES_PER_FLUSH - 1, FRAMES_PER_FLUSH, 3 * FRAMES_PER_FLUSH + 2])
def test_frames_are_read_back_exactly(tmp_path, count):
    positions, velocities = write(tmp_path / "a.h5", count)
    with Trajectory(tmp_path / "a.h5") as trajectory:
        assert len(trajectory) == count
        np.testing.assert_array_equal(trajectory.positions[:], positions)
        np.testing.assert_array_equal(trajectory.velocities[:], velocities)
        assert trajectory.scene.to_yaml() == SCENE.to_yaml()
        assert trajectory.provenance == Provenance("a model", 7, __version__)


def test_the_layout_is_the_one_that_other_programs_read(tmp_path):
    write(tmp_path / "a.h5", 10)
    with h5py.File(tmp_path / "a.h5") as file:
        assert set(file) == {"00000"}
        group = file["00000"]
        assert set(group) == {"position", "velocity", "particle_type"}
        for name in ("position", "velocity"):
            data = group[name]
            assert data.shape == (10, PARTICLES, 3)
            assert data.dtype == np.float32
            assert data.chunks == (2, PARTICLES, 3)
            assert (data.compression, data.compression_opts, data.shuffle) == ("gzip", 1, True)
        assert group["particle_type"].shape == (PARTICLES,)
        assert (group["particle_type"][:] == 0).all()
        assert set(file.attrs) == {"scene", "frame_time", "radius", "model", "seed", "version"}
        assert (file.attrs["frame_time"], file.attrs["radius"]) == (0.005, 0.015)


def test_equal_frames_give_equal_bytes(tmp_path):
    write(tmp_path / "a.h5", 20)
    write(tmp_path / "b.h5", 20)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


@pytest.mark.parametrize("mesh", ["runs/knot.obj", "meshes/knot.obj"])
def test_a_trajectory_can_move_with_the_meshes_in_its_folder_and_without_others(tmp_path, mesh):
    (tmp_path / "scene.yaml").write_text(
        f"surface: {{mesh: {{file: {mesh}}}}}\nfluid: [{{block: {{min: [0, 0, 1], max: [0.1, 0.1, 1.2]}}}}]"
    )
    (tmp_path / mesh).parent.mkdir()
    shutil.copy("examples/knot.obj", tmp_path / mesh)
    folder = tmp_path / "runs"
    folder.mkdir(exist_ok=True)
    with TrajectoryWriter(folder / "a.h5", Scene.load(tmp_path / "scene.yaml"), Provenance("a model"), PARTICLES):
        pass
    folder.rename(tmp_path / "elsewhere")
    with Trajectory(tmp_path / "elsewhere" / "a.h5") as trajectory:
        assert trajectory.scene.build_surface() is not None


def test_velocities_are_rounded_to_the_velocity_step(tmp_path):
    positions, velocities = np.random.default_rng(1).normal(size=(2, 3, PARTICLES, 3)).astype(np.float32)
    with writer(tmp_path / "a.h5") as out:
        for frame in zip(positions, velocities, strict=True):
            out.append(*frame)
    with Trajectory(tmp_path / "a.h5") as trajectory:
        np.testing.assert_array_equal(trajectory.positions[:], positions)
        np.testing.assert_allclose(trajectory.velocities[:], velocities, rtol=0, atol=0.51 * VELOCITY_STEP)


@pytest.mark.parametrize(("first", "count"), [(0, 1), (0, 13), (1, 6), (2, 6), (12, 1), (11, 2), (3, 0)])
def test_a_window_equals_what_hdf5_reads(tmp_path, first, count):
    positions, velocities = write(tmp_path / "a.h5", 13)
    with Trajectory(tmp_path / "a.h5") as trajectory:
        window = trajectory.window(first, count)
        np.testing.assert_array_equal(window[0], positions[first : first + count])
        np.testing.assert_array_equal(window[1], velocities[first : first + count])


def test_a_window_of_a_file_from_another_program_is_read(tmp_path):
    positions, velocities = write(tmp_path / "a.h5", 13)
    with h5py.File(tmp_path / "a.h5", "a") as file:
        for name in ("position", "velocity"):
            values = file[f"00000/{name}"][:]
            del file[f"00000/{name}"]
            file.create_dataset(f"00000/{name}", data=values, chunks=(5, 7, 3), compression="lzf")
    with Trajectory(tmp_path / "a.h5") as trajectory:
        np.testing.assert_array_equal(trajectory.window(2, 6)[0], positions[2:8])
        np.testing.assert_array_equal(trajectory.window(2, 6)[1], velocities[2:8])


def test_the_caller_may_reuse_the_buffer_of_a_frame(tmp_path):
    buffer = np.zeros((PARTICLES, 3))
    with writer(tmp_path / "a.h5") as out:
        for number in range(3):
            buffer[:] = number
            out.append(buffer, -buffer)
    with Trajectory(tmp_path / "a.h5") as trajectory:
        np.testing.assert_array_equal(trajectory.positions[:, 0, 0], [0, 1, 2])
        np.testing.assert_array_equal(trajectory.velocities[:, 0, 0], [0, -1, -2])


def test_a_frame_of_another_size_is_an_error_that_keeps_the_earlier_frames(tmp_path):
    positions, velocities = frames(3)
    with pytest.raises(ValueError, match="a frame is of shape"), writer(tmp_path / "a.h5") as out:
        out.append(positions[0], velocities[0])
        out.append(positions[1, :-1], velocities[1])
    with Trajectory(tmp_path / "a.h5") as trajectory:
        np.testing.assert_array_equal(trajectory.positions[:], positions[:1])


@pytest.mark.parametrize("kind", [RuntimeError, KeyboardInterrupt])
@pytest.mark.parametrize("done", [3, FRAMES_PER_FLUSH, FRAMES_PER_FLUSH + 5])
def test_an_error_or_interrupt_keeps_the_finished_frames(tmp_path, kind, done):
    positions, velocities = frames(done)
    with pytest.raises(kind), writer(tmp_path / "a.h5") as out:
        for frame in zip(positions, velocities, strict=True):
            out.append(*frame)
        raise kind
    with Trajectory(tmp_path / "a.h5") as trajectory:
        np.testing.assert_array_equal(trajectory.positions[:], positions)
        np.testing.assert_array_equal(trajectory.velocities[:], velocities)


def test_an_interrupt_while_writing_duplicates_no_frame(tmp_path, monkeypatch):
    positions, velocities = frames(FRAMES_PER_FLUSH)
    write_values = module.write_chunks
    interrupted = []

    def interrupt_once(data, *given):
        write_values(data, *given)
        if not interrupted:
            interrupted.append(data.name)
            raise KeyboardInterrupt

    monkeypatch.setattr(module, "write_chunks", interrupt_once)
    with pytest.raises(KeyboardInterrupt), writer(tmp_path / "a.h5") as out:
        for frame in zip(positions, velocities, strict=True):
            out.append(*frame)
    assert interrupted == ["/00000/position"]
    with Trajectory(tmp_path / "a.h5") as trajectory:
        np.testing.assert_array_equal(trajectory.positions[:], positions)
        np.testing.assert_array_equal(trajectory.velocities[:], velocities)


def damage(path: Path, how: str) -> None:
    if how == "absent":
        path.unlink()
    elif how == "a folder":
        path.unlink()
        path.mkdir()
    elif how == "empty":
        path.write_bytes(b"")
    elif how == "text":
        path.write_text("not HDF5 at all")
    elif how == "cut off":
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    else:
        with h5py.File(path, "a") as file:
            if how == "no group":
                del file["00000"]
            elif how == "no velocity":
                del file["00000/velocity"]
            elif how == "group is data":
                del file["00000"]
                file["00000"] = 3
            elif how == "flat positions":
                del file["00000/position"]
                file["00000/position"] = np.zeros(7)
            elif how == "fewer velocities":
                file["00000/velocity"].resize(1, axis=0)
            elif how == "no scene":
                del file.attrs["scene"]
            elif how == "seed is a word":
                file.attrs["seed"] = "none"
            elif how == "scene of nonsense":
                file.attrs["scene"] = "fluid: ["


@pytest.mark.parametrize(
    "how",
    [
        "absent",
        "a folder",
        "empty",
        "text",
        "cut off",
        "no group",
        "no velocity",
        "group is data",
        "flat positions",
        "fewer velocities",
        "no scene",
        "seed is a word",
        "scene of nonsense",
    ],
)
def test_anything_but_a_trajectory_is_an_error_of_one_line(tmp_path, how):
    path = tmp_path / "a.h5"
    write(path, 3)
    damage(path, how)
    with pytest.raises(InputError) as error:
        Trajectory(path)
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)


def test_an_unwritable_file_is_an_error_of_one_line(tmp_path):
    for path in (tmp_path / "no" / "folder" / "a.h5", tmp_path):
        with pytest.raises(InputError, match="cannot be written") as error:
            writer(path)
        assert "\n" not in str(error.value)


def fill(out: TrajectoryWriter, count: int) -> None:
    random = np.random.default_rng(0)
    for _ in range(count):
        frame = random.normal(size=(2, 500, 3)).astype(np.float32)
        out.append(*frame)


def assert_full_disk_is_one_line(path: Path) -> None:
    with pytest.raises(InputError) as error, writer(path, particles=500) as out:
        fill(out, 1000)
    assert str(error.value).startswith(f"{path}: cannot be written: the disk is full")
    assert "\n" not in str(error.value)
    with Trajectory(path) as trajectory:
        assert len(trajectory) > 0
        assert len(trajectory) % FRAMES_PER_FLUSH == 0
        assert np.isfinite(trajectory.velocities[:]).all()


@pytest.fixture
def small_disk(tmp_path):
    disk = tmp_path / "disk"
    disk.mkdir()
    options = ["-t", "tmpfs", "-o", "size=1m", "tmpfs"]
    if os.geteuid() != 0 or subprocess.run(["mount", *options, disk], capture_output=True).returncode:
        pytest.skip("only root may mount a small disk")
    yield disk
    subprocess.run(["umount", disk], check=True)


def test_a_full_disk_is_an_error_of_one_line_and_earlier_frames_stay_readable(small_disk):
    assert_full_disk_is_one_line(small_disk / "a.h5")


def test_a_simulated_full_disk_is_the_same_error(tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    free = iter([10**9, 10**9, 10**9, 0])
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=next(free, 0)))
    assert_full_disk_is_one_line(tmp_path / "a.h5")


def test_a_full_disk_does_not_hide_an_earlier_error(tmp_path, monkeypatch):
    with pytest.raises(ZeroDivisionError), writer(tmp_path / "a.h5", particles=500) as out:
        fill(out, 3)
        usage = shutil.disk_usage(tmp_path)
        monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=0))
        raise ZeroDivisionError


def test_frames_are_read_without_a_readable_scene(tmp_path):
    positions, velocities = write(tmp_path / "a.h5", 6)
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.attrs["scene"] = "an unreadable scene"
    with TrajectoryFrames(tmp_path / "a.h5") as trajectory:
        assert len(trajectory) == 6
        for one, other in zip(trajectory.window(2, 3), (positions, velocities), strict=True):
            np.testing.assert_array_equal(one, other[2:5])
    with pytest.raises(InputError, match="scene"):
        Trajectory(tmp_path / "a.h5")


def test_poses_are_kept_by_name_and_a_file_without_any_has_none(tmp_path):
    path = tmp_path / "t.h5"
    zero = np.zeros((2, 3), np.float32)
    with TrajectoryWriter(path, SCENE, Provenance("a test"), 2) as writer:
        for frame in range(20):  # one solid moves from the start, another from frame 10 on
            poses = {"cup": Pose.of((frame, 0, 0))}
            if frame >= 10:
                poses["a lid"] = Pose.of((0, frame, 0), (0, 1, 0, 0))
            writer.append(zero, zero, poses)
    with Trajectory(path) as trajectory:
        assert set(trajectory.poses) == {"cup", "a lid"}
        np.testing.assert_array_equal(trajectory.poses["cup"][:, 0], np.arange(20))
        np.testing.assert_array_equal(trajectory.poses["a lid"][:, 1], np.maximum(np.arange(20), 10))
        np.testing.assert_array_equal(trajectory.poses["a lid"][0, 3:], (0, 1, 0, 0))
    with TrajectoryWriter(path, SCENE, Provenance("a test"), 2) as writer:
        writer.append(zero, zero)
    with Trajectory(path) as trajectory:
        assert trajectory.poses == {}


def test_frames_without_poses_keep_the_last_ones(tmp_path):
    path = tmp_path / "t.h5"
    zero = np.zeros((2, 3), np.float32)
    with TrajectoryWriter(path, SCENE, Provenance("a test"), 2) as writer:
        for frame in range(30):
            writer.append(zero, zero, {"cup": Pose.of((frame, 0, 0))} if frame < 11 else None)
            if frame == 20:
                writer.flush()
    with Trajectory(path) as trajectory:
        np.testing.assert_array_equal(trajectory.poses["cup"][:, 0], np.minimum(np.arange(30), 10))


def test_the_trajectory_that_a_scene_continues_is_not_replaced(tmp_path):
    write(tmp_path / "a.h5", 3)
    before = (tmp_path / "a.h5").read_bytes()
    for restart in (tmp_path / "a.h5", tmp_path / "other" / ".." / "a.h5"):
        with pytest.raises(InputError, match="is the trajectory that the scene continues; write to another file"):
            TrajectoryWriter(tmp_path / "a.h5", SCENE.with_changes(restart=restart), Provenance("a model"), PARTICLES)
    assert (tmp_path / "a.h5").read_bytes() == before


def test_forces_are_kept_by_name_and_are_unknown_in_the_first_frame(tmp_path):
    path, count = tmp_path / "trajectory.h5", FRAMES_PER_FLUSH + 3
    positions, velocities = frames(count)
    rows = np.random.default_rng(1).normal(size=(count, 2, 3))
    with writer(path) as writing:
        for number in range(count):
            forces = {} if number == 0 else {"ball": Wrench(*rows[number])}
            writing.append(positions[number], velocities[number], forces=forces)
    with Trajectory(path) as trajectory:
        for values, column in ((trajectory.forces, 0), (trajectory.torques, 1)):
            assert list(values) == ["ball"] and values["ball"].shape == (count, 3)
            assert np.isnan(values["ball"][0]).all()
            np.testing.assert_array_equal(values["ball"][1:], rows[1:, column])
    with h5py.File(path) as file:
        assert file["00000/forces/ball"].shape == file["00000/torques/ball"].shape == (count, 3)


def test_a_file_without_forces_has_none(tmp_path):
    path = tmp_path / "trajectory.h5"
    positions, velocities = frames(2)
    with writer(path) as writing:
        writing.append(positions[0], velocities[0])
    with h5py.File(path) as file:
        assert "forces" not in file["00000"]
    with Trajectory(path) as trajectory:
        assert trajectory.forces == trajectory.torques == {}


def test_forces_of_another_shape_are_an_error_of_one_line(tmp_path):
    path = tmp_path / "trajectory.h5"
    positions, velocities = frames(2)
    with writer(path) as writing:
        writing.append(positions[0], velocities[0])
    with h5py.File(path, "a") as file:
        file["00000/forces/ball"] = np.zeros((2, 4))
    with pytest.raises(InputError, match="is not \\(frames, 3\\)"):
        Trajectory(path)


def test_a_run_that_fails_leaves_the_older_trajectory_and_keeps_its_own_frames_beside_it(tmp_path):
    path = tmp_path / "water.h5"
    write(path, 3)
    with pytest.raises(SimulationError), writer(path) as out:
        for frame in range(10):
            out.append(*np.full((2, *out._buffer.shape[2:]), frame, np.float32))
        raise SimulationError("failed")
    with Trajectory(path) as older, Trajectory(tmp_path / "water.new.h5") as newer:
        assert (len(older), len(newer)) == (3, 10)
    assert out.path == tmp_path / "water.new.h5"
    with writer(path) as out:
        out.append(*np.zeros((2, *out._buffer.shape[2:]), np.float32))
    with Trajectory(path) as replaced:
        assert len(replaced) == 1
    assert [file.name for file in tmp_path.iterdir()] == ["water.h5"]


def test_an_interrupt_before_the_first_frame_leaves_the_older_file_and_no_other(tmp_path, monkeypatch):
    path = tmp_path / "a.h5"
    path.write_bytes(b"older")

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(module.h5py.Group, "create_dataset", interrupted)
    with pytest.raises(KeyboardInterrupt):
        TrajectoryWriter(path, SCENE, Provenance("a test"), 2)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"older"]
