import h5py
import numpy as np

from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import VELOCITY_STEP
from tests.io.trajectories import PARTICLES, write, writer


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


def test_velocities_are_rounded_to_the_velocity_step(tmp_path):
    positions, velocities = np.random.default_rng(1).normal(size=(2, 3, PARTICLES, 3)).astype(np.float32)
    with writer(tmp_path / "a.h5") as out:
        for frame in zip(positions, velocities, strict=True):
            out.append(*frame)
    with Trajectory(tmp_path / "a.h5") as trajectory:
        np.testing.assert_array_equal(trajectory.positions[:], positions)
        np.testing.assert_allclose(trajectory.velocities[:], velocities, rtol=0, atol=0.51 * VELOCITY_STEP)
