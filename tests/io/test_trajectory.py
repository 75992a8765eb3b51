import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from surfsup import __version__
from surfsup.errors import InputError
from surfsup.io.trajectory import Trajectory, TrajectoryFrames
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import FRAMES_PER_FLUSH, TrajectoryWriter
from surfsup.scene import Scene
from tests.io.trajectories import PARTICLES, SCENE, frames, write, writer


@pytest.mark.parametrize("count", [0, 1, 2, FRAMES_PER_FLUSH - 1, FRAMES_PER_FLUSH, 3 * FRAMES_PER_FLUSH + 2])
def test_frames_are_read_back_exactly(tmp_path, count):
    positions, velocities = write(tmp_path / "a.h5", count)
    with Trajectory(tmp_path / "a.h5") as trajectory:
        assert len(trajectory) == count
        np.testing.assert_array_equal(trajectory.positions[:], positions)
        np.testing.assert_array_equal(trajectory.velocities[:], velocities)
        assert trajectory.scene.to_yaml() == SCENE.to_yaml()
        assert trajectory.provenance == Provenance("a model", 7, __version__)


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


def test_forces_of_another_shape_are_an_error_of_one_line(tmp_path):
    path = tmp_path / "trajectory.h5"
    positions, velocities = frames(2)
    with writer(path) as writing:
        writing.append(positions[0], velocities[0])
    with h5py.File(path, "a") as file:
        file["00000/forces/ball"] = np.zeros((2, 4))
    with pytest.raises(InputError, match="is not \\(frames, 3\\)"):
        Trajectory(path)
