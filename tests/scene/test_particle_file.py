import numpy as np
import pytest
import pyvista

from surfsup.errors import InputError
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Block, ParticleFile, Scene
from surfsup.scene.particle_file import read_particles
from surfsup.sdf import Sphere

POSITIONS = Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7)).positions()
VELOCITIES = POSITIONS - POSITIONS.mean(axis=0)


def write(path, positions=POSITIONS, velocities=VELOCITIES):
    """Write particles as a file of the kind that the suffix of ``path`` names."""
    both = np.concatenate([positions, velocities], axis=1)
    if path.suffix == ".npy":
        np.save(path, both)
    elif path.suffix == ".csv":
        np.savetxt(path, both, delimiter=",", header="x,y,z,vx,vy,vz", comments="")
    elif path.suffix == ".h5":
        scene = Scene(fluid=[Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))])
        with TrajectoryWriter(path, scene, Provenance("a test"), len(positions)) as writer:
            for shift in (0.2, 0.1, 0.0):
                writer.append(positions + np.float32(shift), velocities)
    else:
        cloud = pyvista.PolyData(positions)
        cloud.point_data["velocity"] = velocities
        cloud.save(path)
    return path


def start_of(path, surface=None, **keys):
    scene = Scene(fluid=[ParticleFile(file=path, **keys)], surface=surface)
    return scene.initial_particles(surface)


@pytest.mark.parametrize("suffix", [".npy", ".csv", ".vtp", ".h5"])
def test_positions_and_velocities_come_from_a_file(tmp_path, suffix):
    start = start_of(write(tmp_path / f"water{suffix}"))
    np.testing.assert_allclose(start.positions, POSITIONS, atol=1e-6)
    np.testing.assert_allclose(start.velocities, VELOCITIES, atol=1e-5)


def test_a_ply_file_and_positions_alone_are_at_rest(tmp_path):
    pyvista.PolyData(POSITIONS).save(tmp_path / "water.ply")
    np.save(tmp_path / "water.npy", POSITIONS.astype(np.float64))
    (tmp_path / "water.csv").write_text("\n".join(",".join(map(str, row)) for row in POSITIONS))
    for name in ("water.ply", "water.npy", "water.csv"):
        start = start_of(tmp_path / name)
        np.testing.assert_allclose(start.positions, POSITIONS, atol=1e-6)
        assert not start.velocities.any()


def test_a_velocity_replaces_those_of_the_file_and_a_frame_chooses(tmp_path):
    path = write(tmp_path / "water.h5")
    start = start_of(path, frame=1, velocity=(0, 0, -1))
    np.testing.assert_allclose(start.positions, POSITIONS + 0.1, atol=1e-6)
    np.testing.assert_array_equal(start.velocities, np.broadcast_to([0, 0, -1.0], POSITIONS.shape))
    assert read_particles(path).time == pytest.approx(0.01)


def test_a_path_is_relative_to_the_scene_file_and_moves_with_it(tmp_path):
    write(tmp_path / "water.npy")
    (tmp_path / "deeper").mkdir()
    (tmp_path / "scene.yaml").write_text("fluid: [{particles: {file: water.npy}}]")
    scene = Scene.load(tmp_path / "scene.yaml").with_paths_relative_to(tmp_path / "deeper", tmp_path)
    assert "file: ../water.npy" in scene.to_yaml()
    assert len(scene.initial_particles(None).positions) == len(POSITIONS)


BAD_ROW = np.array([[np.nan, 0, 0]], np.float32)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            np.concatenate([POSITIONS, BAD_ROW]),
            "1 of its 126 particles have values that are not finite .* is number 125",
        ),
        (POSITIONS[:, :2], r"is an array of shape \(125, 2\), but particles are \(N, 3\)"),
        (np.zeros((0, 3)), "has no particles"),
        (np.concatenate([POSITIONS, POSITIONS[:1] + 0.0005]), r"2 of its 126 particles are closer than 0\.0015 m to"),
        (0.4 * POSITIONS + [0, 0, 0.3], r"125 of its 125 particles are closer than 0\.015 m .* a spacing is 0\.03 m"),
        (POSITIONS + np.float32([0.44, 0, 0]), "25 of its 125 particles are outside the container"),
        (
            POSITIONS - np.float32([0, 0, 0.4]),
            "particles are inside the solid, or closer to it than their radius; the first",
        ),
        (np.array([{}], dtype=object), "cannot be read as particles"),
    ],
)
def test_a_file_that_cannot_start_a_scene_is_an_error_of_one_line(tmp_path, values, message):
    path = tmp_path / "water.npy"
    np.save(path, values, allow_pickle=True)
    with pytest.raises(InputError, match=message) as error:
        start_of(path, surface=Sphere(0.2))
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)


def test_text_that_holds_no_numbers_and_a_missing_file_are_errors_of_one_line(tmp_path):
    (tmp_path / "words.csv").write_text("x,y,z\n1,2,three\n")
    (tmp_path / "broken.h5").write_bytes(b"nothing")
    for name, message in (("words.csv", "cannot be read"), ("broken.h5", "cannot be read"), ("no.npy", "no such file")):
        with pytest.raises(InputError, match=message) as error:
            start_of(tmp_path / name)
        assert "\n" not in str(error.value)


def test_a_trajectory_of_another_radius_and_a_frame_beyond_the_end_are_refused(tmp_path):
    path = write(tmp_path / "water.h5")
    with pytest.raises(
        InputError, match=r"has particles of radius 0\.015 m, but the scene of 0\.03 m; set particle_ra"
    ):
        Scene(fluid=[ParticleFile(file=path)], particle_radius=0.03).initial_particles(None)
    with pytest.raises(InputError, match="has the frames 0 to 2, not 3"):
        start_of(path, frame=3)
    with pytest.raises(InputError, match="only a trajectory has frames"):
        start_of(write(tmp_path / "water.npy"), frame=0)


def test_other_kinds_of_files_are_refused():
    with pytest.raises(InputError, match=r"particles are read from \.npy, \.csv, \.ply"):
        ParticleFile(file="water.pkl")
