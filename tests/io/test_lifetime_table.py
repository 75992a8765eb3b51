"""Trajectories in which water enters and leaves."""

import h5py
import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.io.cut_off import open_readable
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import LIFETIMES, Provenance
from surfsup.io.trajectory_writer import FRAMES_PER_FLUSH, TrajectoryWriter
from surfsup.scene import Scene
from surfsup.scene.particle_file import read_particles

SCENE = Scene.from_yaml("taps: [{disc: {radius: 0.05}, at: [0, 0, 1], speed: 1}]", "test")
IDS = [[0, 1], [0, 1, 2], [1, 2], [1, 2, 3, 4]]


def write(path, ids=IDS, particles=6):
    """Frame k has particle i at (k, i, 0)."""
    with TrajectoryWriter(path, SCENE, Provenance("test"), particles) as writer:
        for number, here in enumerate(ids):
            positions = np.array([[number, i, 0] for i in here], np.float32).reshape(-1, 3)
            writer.append(positions, np.ones_like(positions), None, np.array(here, np.int64))
    return writer


def test_a_particle_has_its_column_and_nan_where_it_is_not_in_the_scene(tmp_path):
    write(tmp_path / "t.h5")
    with Trajectory(tmp_path / "t.h5") as trajectory:
        assert trajectory.positions.shape == (4, 6, 3)
        for number, here in enumerate(IDS):
            np.testing.assert_array_equal(trajectory.ids(number), here)
            np.testing.assert_array_equal(trajectory.positions[number][here, 1], here)
            absent = np.setdiff1d(np.arange(6), here)
            assert np.isnan(trajectory.positions[number][absent]).all()
            assert np.isnan(trajectory.velocities[number][absent]).all()
        assert trajectory.lifetimes.tolist() == [[0, 2], [0, 4], [1, 4], [3, 4], [3, 4], [0, 0]]


def test_the_writer_counts_what_entered_and_left(tmp_path):
    writer = write(tmp_path / "t.h5")
    assert (writer.particles, writer.entered, writer.left) == (5, 3, 1)


def test_lifetimes_grow_over_many_flushes(tmp_path):
    ids = [list(range(1 + number // 3)) for number in range(3 * FRAMES_PER_FLUSH + 2)]
    write(tmp_path / "t.h5", ids, particles=9)
    with Trajectory(tmp_path / "t.h5") as trajectory:
        assert [len(trajectory.ids(number)) for number in range(len(ids))] == [len(here) for here in ids]


def test_a_file_in_which_nothing_enters_or_leaves_is_as_it_always_was(tmp_path):
    write(tmp_path / "t.h5", [[0, 1]] * 3, particles=2)
    with h5py.File(tmp_path / "t.h5") as file:
        assert LIFETIMES not in file
    with Trajectory(tmp_path / "t.h5") as trajectory:
        assert trajectory.lifetimes is None
        np.testing.assert_array_equal(trajectory.ids(2), [0, 1])


def test_a_frame_as_the_start_of_a_scene_has_the_particles_that_are_in_it(tmp_path):
    write(tmp_path / "t.h5")
    np.testing.assert_array_equal(read_particles(tmp_path / "t.h5").positions[:, 1], [1, 2, 3, 4])
    np.testing.assert_array_equal(read_particles(tmp_path / "t.h5", 1).positions[:, 1], [0, 1, 2])


def test_a_frame_of_another_number_of_particles_than_ids_is_refused(tmp_path):
    refused = pytest.raises(ValueError, match=r"is of shape \(3, 3\) instead of \(2, 3\)")
    with TrajectoryWriter(tmp_path / "t.h5", SCENE, Provenance("test"), 6) as writer, refused:
        writer.append(np.zeros((3, 3)), np.zeros((3, 3)), None, np.arange(2))


def test_lifetimes_of_another_number_of_particles_are_refused(tmp_path):
    write(tmp_path / "t.h5")
    with h5py.File(tmp_path / "t.h5", "r+") as file:
        del file[LIFETIMES]
        file[LIFETIMES] = np.zeros((3, 2), np.int64)
    with pytest.raises(InputError, match="is not a trajectory"):
        Trajectory(tmp_path / "t.h5")


def test_a_file_that_was_cut_off_opens(tmp_path):
    write(tmp_path / "t.h5", [[0, 1]] + [[0, 1, 2]] * 40, particles=3)
    data = (tmp_path / "t.h5").read_bytes()
    (tmp_path / "cut.h5").write_bytes(data[:-200])
    with open_readable(tmp_path / "cut.h5") as trajectory:
        assert len(trajectory.ids(0)) == 2
