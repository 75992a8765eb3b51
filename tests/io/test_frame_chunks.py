import h5py
import numpy as np
import pytest

from surfsup.io.trajectory import Trajectory
from tests.io.trajectories import write


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
