import os
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from surfsup.errors import InputError, SimulationError
from surfsup.io import trajectory_writer as module
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import FRAMES_PER_FLUSH, TrajectoryWriter
from tests.io.trajectories import PARTICLES, SCENE, frames, write, writer


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


def test_the_trajectory_that_a_scene_continues_is_not_replaced(tmp_path):
    write(tmp_path / "a.h5", 3)
    before = (tmp_path / "a.h5").read_bytes()
    for restart in (tmp_path / "a.h5", tmp_path / "other" / ".." / "a.h5"):
        with pytest.raises(InputError, match="is the trajectory that the scene continues; write to another file"):
            TrajectoryWriter(tmp_path / "a.h5", SCENE.with_changes(restart=restart), Provenance("a model"), PARTICLES)
    assert (tmp_path / "a.h5").read_bytes() == before


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

    monkeypatch.setattr(h5py.Group, "create_dataset", interrupted)
    with pytest.raises(KeyboardInterrupt):
        TrajectoryWriter(path, SCENE, Provenance("a test"), 2)
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"older"]
