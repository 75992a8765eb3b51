import h5py
import numpy as np

from surfsup.io.named_rows import NamedRows, held, unknown
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import FRAMES_PER_FLUSH, TrajectoryWriter
from surfsup.scene.pose import Pose
from surfsup.scene.wrench import Wrench
from tests.io.trajectories import SCENE, frames, writer


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


def test_a_solid_that_comes_late_has_its_first_row_in_earlier_frames(tmp_path):
    """Rows are written again from the same place where the buffer was not full."""
    with h5py.File(tmp_path / "rows.h5", "w") as file:
        positions, forces = NamedRows("pose", 2, held), NamedRows("force", 2, unknown)
        for number in range(2):
            for rows in (positions, forces):
                rows.put(number, {"cup": np.array([number, 0.0])})
                rows.write(file, 0)
        for rows in (positions, forces):
            rows.put(0, {"lid": np.array([2.0, 3.0])})
            rows.write(file, 2)
        np.testing.assert_array_equal(file["pose/cup"][:], [[0, 0], [1, 0], [1, 0]])
        np.testing.assert_array_equal(file["pose/lid"][:], [[2, 3]] * 3)
        np.testing.assert_array_equal(file["force/cup"][:], [[0, 0], [1, 0], [np.nan, np.nan]])
        np.testing.assert_array_equal(file["force/lid"][:], [[np.nan, np.nan], [np.nan, np.nan], [2, 3]])
