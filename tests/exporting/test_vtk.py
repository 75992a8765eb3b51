"""VTK files, read by VTK's own readers, which are those of ParaView."""

import numpy as np
import pytest
import pyvista
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup.exporting import legacy_vtk, vtu
from tests.exporting.conftest import cloud, tetrahedron

FORMATS = [(legacy_vtk, ".vtk"), (vtu, ".vtu")]


def read(folder, content, suffix):
    path = folder / f"frame{suffix}"
    path.write_bytes(content)
    return pyvista.read(path)


@pytest.mark.parametrize(("form", "suffix"), FORMATS)
@settings(max_examples=20)
@given(count=st.integers(0, 40), seed=st.integers(0, 100))
def test_particles_come_back(form, suffix, count, seed, tmp_path_factory):
    frame = cloud(count, seed)
    grid = read(tmp_path_factory.mktemp("vtk"), form.particles(frame), suffix)
    assert (grid.n_points, grid.n_cells) == (count, count)
    if count:
        np.testing.assert_array_equal(grid.points, frame.positions)
        np.testing.assert_array_equal(grid.point_data["velocity"], frame.velocities)
        np.testing.assert_array_equal(grid.point_data["id"], frame.ids)
        np.testing.assert_allclose(grid.point_data["radius"], 0.015)


@pytest.mark.parametrize(("form", "suffix"), FORMATS)
def test_a_mesh_comes_back(form, suffix, tmp_path):
    frame = tetrahedron()
    grid = read(tmp_path, form.mesh(frame), suffix)
    np.testing.assert_array_equal(grid.points, frame.vertices)
    np.testing.assert_array_equal(grid.cells_dict[pyvista.CellType.TRIANGLE], frame.triangles)
    np.testing.assert_array_equal(grid.point_data["velocity"], frame.velocities)
    np.testing.assert_array_equal(grid.point_data["normal"], frame.normals)


def test_the_time_is_in_the_file(tmp_path):
    assert read(tmp_path, vtu.particles(cloud(3, time=0.125)), ".vtu").field_data["TimeValue"][0] == 0.125
    assert legacy_vtk.particles(cloud(3, time=0.125)).splitlines()[1] == b"surfsup, time 0.125 s"


def test_a_collection_has_the_times_of_its_files(tmp_path):
    times = [0.0, 1 / 24, 2 / 24]
    for number, time in enumerate(times):
        (tmp_path / f"water & {number}.vtu").write_bytes(vtu.particles(cloud(number + 2, time=time)))
    path = tmp_path / "water.pvd"
    path.write_bytes(vtu.collection((time, f"water & {number}.vtu") for number, time in enumerate(times)))
    reader = pyvista.PVDReader(str(path))
    np.testing.assert_allclose(reader.time_values, times, atol=1e-9)
    reader.set_active_time_point(2)
    np.testing.assert_array_equal(reader.read()[0].points, cloud(4).positions)
