"""PLY files, read by VTK and trimesh."""

import io

import numpy as np
import pyvista
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from surfsup.exporting import ply
from tests.exporting.conftest import cloud, tetrahedron


def elements(content):
    """All values of the vertices, as trimesh reads them."""
    return trimesh.load(io.BytesIO(content), file_type="ply", process=False).metadata["_ply_raw"]["vertex"]["data"]


@given(st.integers(1, 40), st.integers(0, 100))
def test_particles_come_back(count, seed):
    frame = cloud(count, seed)
    data = elements(ply.particles(frame))
    np.testing.assert_array_equal(np.stack([data["x"], data["y"], data["z"]], axis=1), frame.positions)
    np.testing.assert_array_equal(np.stack([data["vx"], data["vy"], data["vz"]], axis=1), frame.velocities)
    np.testing.assert_array_equal(data["id"], frame.ids)
    np.testing.assert_allclose(data["radius"], 0.015)


def test_no_particles_are_a_file_too(tmp_path):
    path = tmp_path / "empty.ply"
    path.write_bytes(ply.particles(cloud(0)))
    assert pyvista.read(path).n_points == 0


def test_a_mesh_comes_back_with_its_velocities(tmp_path):
    frame, path = tetrahedron(), tmp_path / "mesh.ply"
    content = ply.mesh(frame)
    path.write_bytes(content)
    mesh = pyvista.read(path)
    np.testing.assert_array_equal(mesh.points, frame.vertices)
    np.testing.assert_array_equal(mesh.regular_faces, frame.triangles)
    np.testing.assert_array_equal(mesh.point_data["Normals"], frame.normals)
    data = elements(content)
    np.testing.assert_array_equal(np.stack([data["vx"], data["vy"], data["vz"]], axis=1), frame.velocities)


def test_the_header_has_the_time():
    assert b"comment time 0.25 s\n" in ply.particles(cloud(1))
