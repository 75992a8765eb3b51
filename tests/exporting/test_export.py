"""Whole exports: files, rates, contents, and what bad input leaves behind."""

import resource
from contextlib import contextmanager

import numpy as np
import pytest
import pyvista
import trimesh

from surfsup.errors import InputError
from surfsup.exporting import formats
from surfsup.exporting.export import export
from surfsup.io.trajectory import Trajectory
from surfsup.scene import Scene
from surfsup.simulation import Simulation
from surfsup.viewing.reconstruction import Reconstruction

COARSE = Reconstruction(cube_size=1.5, mesh_smoothing=0)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_sequence_has_numbered_files_and_reports_progress(trajectory, tmp_path):
    steps = []
    done = export(trajectory, "bgeo", tmp_path / "new" / "folder", fps=25, progress=lambda *step: steps.append(step))
    assert names(tmp_path / "new" / "folder") == [f"particles.{number:04d}.bgeo" for number in range(1, 9)]
    assert (done.frames, done.cut_off) == (8, False)
    assert done.files == (tmp_path / "new" / "folder" / "particles.0001.bgeo",)
    assert steps == [(number, 8) for number in range(1, 9)]


def test_everything_is_particles_surface_and_solid(trajectory, tmp_path):
    done = export(trajectory, "vtu", tmp_path, fps=10, what="all", reconstruction=COARSE)
    numbered = [f"{name}.{number:04d}.vtu" for name in ("particles", "surface") for number in range(1, 5)]
    assert names(tmp_path) == sorted([*numbered, "particles.pvd", "solid.vtu", "surface.pvd"])
    assert {path.name for path in done.files} == {"particles.pvd", "solid.vtu", "surface.pvd"}
    reader = pyvista.PVDReader(str(tmp_path / "particles.pvd"))
    np.testing.assert_allclose(reader.time_values, [0, 0.1, 0.2, 0.3])
    ball = pyvista.read(tmp_path / "solid.vtu")
    np.testing.assert_allclose(np.linalg.norm(ball.points - [0, 0, 0.2], axis=1), 0.2, atol=1e-3)


def test_the_surface_is_around_the_particles_and_moves_with_them(trajectory, tmp_path):
    export(trajectory, "vtk", tmp_path, fps=20, what="surface", reconstruction=COARSE)
    surface = pyvista.read(tmp_path / "surface.0003.vtk")
    with Trajectory(trajectory) as file:
        positions, velocities = file.positions[20], file.velocities[20]
    for end in (np.min, np.max):
        np.testing.assert_allclose(end(surface.points, axis=0), end(positions, axis=0), atol=0.04)
    low, high = velocities.min(axis=0), velocities.max(axis=0)
    assert ((surface["velocity"] > low - 0.01) & (surface["velocity"] < high + 0.01)).all()
    assert surface["velocity"][:, 2].mean() == pytest.approx(velocities[:, 2].mean(), abs=0.2)


def test_y_is_up_on_request(trajectory, tmp_path):
    for up in ("z", "y"):
        export(trajectory, "npz", tmp_path / up, fps=10, up=up)
    z, y = (np.load(tmp_path / up / "particles.0003.npz") for up in ("z", "y"))
    for name in ("positions", "velocities"):
        np.testing.assert_array_equal(y[name], np.stack([z[name][:, 0], z[name][:, 2], -z[name][:, 1]], axis=1))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"format": "bego"}, "no export format 'bego'; did you mean 'bgeo'"),
        ({"format": "qqq"}, "the formats are vtk, vtu"),
        ({"fps": 0}, "0 frames per second"),
        ({"fps": float("nan")}, "nan frames per second"),
        ({"what": "water"}, "give one of particles, surface, solid, all"),
        ({"what": "surface"}, "npz holds particles, not surface; these hold it: vtk, vtu"),
        ({"format": "obj", "what": "particles"}, "obj holds surface and solid, not particles"),
        ({"format": "glb", "up": "z"}, "always y"),
        ({"up": "x"}, "y or z"),
        ({"trajectory": "absent.h5"}, "there is no such trajectory file"),
        ({"trajectory": __file__}, "not a trajectory"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(options, message, trajectory, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(InputError, match=message) as error:
        export(**{"trajectory": trajectory, "format": "npz", "out": out, **options})
    assert "\n" not in str(error.value)
    assert not out.exists()


def test_a_missing_package_is_named_with_the_command_that_installs_it(trajectory, tmp_path, monkeypatch):
    monkeypatch.setattr(formats, "find_spec", lambda module: None)
    for name in ("usd", "blender"):
        with pytest.raises(InputError, match=r"pip install 'surfsup\[export\]'"):
            export(trajectory, name, tmp_path / "out")
    assert names(tmp_path) == []


def test_a_folder_that_cannot_be_written_is_refused(trajectory, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be used as the output folder"):
        export(trajectory, "npz", tmp_path / "file")


def test_a_mesh_that_is_gone_is_missed_only_where_it_is_needed(tmp_path):
    trimesh.creation.icosphere(1, 0.2).export(tmp_path / "ball.stl")
    (tmp_path / "scene.yaml").write_text(
        "surface: {mesh: {file: ball.stl}, at: [0, 0, 0.2]}\n"
        "fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.6]}}]\nframes: 9"
    )
    Simulation(Scene.load(tmp_path / "scene.yaml"), device="cpu").record(tmp_path / "water.h5")
    (tmp_path / "ball.stl").unlink()
    with pytest.warns(UserWarning, match="particles between two frames may enter the solid, which is missing"):
        assert export(tmp_path / "water.h5", "npz", tmp_path / "out").frames == 1
    with pytest.raises(InputError, match=r"ball.stl"):
        export(tmp_path / "water.h5", "obj", tmp_path / "out", what="solid")


def test_an_older_export_stays_unless_it_may_be_overwritten(trajectory, tmp_path):
    export(trajectory, "npz", tmp_path, fps=25)
    export(trajectory, "bgeo", tmp_path, fps=10)
    before = (tmp_path / "particles.0001.npz").stat().st_mtime_ns
    with pytest.raises(InputError, match=r"particles.0001.npz: exists already; .* --overwrite"):
        export(trajectory, "npz", tmp_path, fps=10)
    assert (tmp_path / "particles.0001.npz").stat().st_mtime_ns == before
    export(trajectory, "npz", tmp_path, fps=10, overwrite=True)
    assert len(list(tmp_path.glob("*.npz"))) == 4  # none of the eight older ones is taken for the new
    assert len(list(tmp_path.glob("*.bgeo"))) == 4


def test_a_trajectory_that_was_cut_off_is_exported_as_far_as_it_is_readable(trajectory, tmp_path):
    cut = tmp_path / "cut.h5"
    cut.write_bytes(trajectory.read_bytes()[: int(0.6 * trajectory.stat().st_size)])
    with pytest.warns(UserWarning, match=r"cut off: only \d+ of 61 frames are readable"):
        done = export(cut, "npz", tmp_path / "out", fps=200)
    assert done.cut_off
    assert 20 < done.frames < 60
    with Trajectory(trajectory) as whole:
        for number in range(done.frames):
            with np.load(tmp_path / "out" / f"particles.{number + 1:04d}.npz") as frame:
                np.testing.assert_array_equal(frame["positions"], whole.positions[number])
    assert len(names(tmp_path / "out")) == done.frames


def test_nothing_readable_is_an_error(trajectory, tmp_path):
    cut = tmp_path / "cut.h5"
    cut.write_bytes(trajectory.read_bytes()[:3000])
    with pytest.raises(InputError, match="not a trajectory of surfsup, or was cut off"):
        export(cut, "npz", tmp_path / "out")


def test_a_scene_without_a_solid_has_none_to_export(tmp_path):
    scene = Scene.from_yaml("fluid: [{block: {min: [-0.1, -0.1, 0.5], max: [0.1, 0.1, 0.6]}}]\nframes: 2", "test")
    Simulation(scene, device="cpu").record(tmp_path / "water.h5")
    with pytest.raises(InputError, match="no solid"):
        export(tmp_path / "water.h5", "obj", tmp_path / "out", what="solid")
    assert export(tmp_path / "water.h5", "obj", tmp_path / "out", what="all").frames == 1


def test_a_full_disk_leaves_no_incomplete_file(trajectory, tmp_path):
    with (
        no_file_above(2000),
        pytest.raises(InputError, match=r"particles.0001.npz: cannot be written \(File too large"),
    ):
        export(trajectory, "npz", tmp_path)
    assert names(tmp_path) == []


@contextmanager
def no_file_above(size):
    """Let this process write no file larger than ``size`` bytes, as if the disk were full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
