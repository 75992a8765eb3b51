"""OBJ and GLB files, read by trimesh, and the meshes themselves."""

import io
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.exporting import glb, obj
from surfsup.exporting.mesh_frame import water_surface
from surfsup.exporting.up_axis import with_up_axis
from surfsup.viewing.reconstruction import Reconstruction
from tests.exporting.conftest import cloud, tetrahedron


def block():
    """Particles on a lattice of 0.03 m, whose velocity is linear in their position."""
    axis = 0.03 * np.arange(8)
    positions = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3).astype(np.float32)
    frame = cloud(len(positions))
    return replace(frame, positions=positions, velocities=positions @ np.diag([1, -2, 3]).astype(np.float32))


def test_the_surface_is_closed_turns_outwards_and_has_the_volume_of_the_water():
    frame = water_surface(block(), Reconstruction())
    mesh = trimesh.Trimesh(frame.vertices, frame.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.24**3, rel=0.15)
    assert (np.einsum("ij,ij->i", frame.normals, frame.vertices - frame.vertices.mean(axis=0)) > 0).all()


def test_a_vertex_has_the_velocity_of_the_water_there():
    frame = water_surface(block(), Reconstruction())
    inside = np.clip(frame.vertices, 0, 0.21)  # vertices are outside of the outermost particles
    np.testing.assert_allclose(frame.velocities, inside * [1, -2, 3], atol=0.06)
    uniform = water_surface(replace(block(), velocities=np.tile(np.float32([1, 2, 3]), (512, 1))), Reconstruction())
    np.testing.assert_allclose(uniform.velocities, np.tile([1, 2, 3], (len(uniform.vertices), 1)), rtol=1e-5)


def test_no_particles_have_an_empty_surface_which_every_format_holds():
    frame = water_surface(cloud(0), Reconstruction())
    assert (len(frame.vertices), len(frame.triangles)) == (0, 0)
    assert b"\nf " not in obj.mesh(frame)
    assert not trimesh.load(io.BytesIO(glb.mesh(frame)), file_type="glb").geometry


def test_parameters_out_of_range_are_refused():
    for bad in ({"cube_size": 0}, {"smoothing_length": float("nan")}, {"mesh_smoothing": -1}):
        with pytest.raises(InputError, match=next(iter(bad)).replace("_", " ")):
            Reconstruction(**bad)


def test_larger_cubes_make_fewer_triangles():
    fine, coarse = (water_surface(block(), Reconstruction(cube_size=size)) for size in (0.7, 1.4))
    assert len(coarse.triangles) < 0.4 * len(fine.triangles)


def test_an_obj_comes_back():
    frame = tetrahedron()
    mesh = trimesh.load(io.BytesIO(obj.mesh(frame)), file_type="obj", process=False)
    np.testing.assert_allclose(mesh.vertices, frame.vertices, rtol=1e-6)
    np.testing.assert_array_equal(mesh.faces, frame.triangles)
    np.testing.assert_allclose(mesh.vertex_normals, frame.normals, atol=1e-3)


def test_a_glb_comes_back_with_velocities():
    frame = with_up_axis(tetrahedron(), "y")
    mesh = trimesh.load(io.BytesIO(glb.mesh(frame)), file_type="glb", process=False).geometry["water"]
    np.testing.assert_array_equal(mesh.vertices, frame.vertices)
    np.testing.assert_array_equal(mesh.faces, frame.triangles)
    np.testing.assert_allclose(mesh.vertex_normals, frame.normals, atol=1e-6)
    np.testing.assert_array_equal(mesh.vertex_attributes["_VELOCITY"], frame.velocities)


def test_the_y_axis_is_up_by_a_rotation():
    z, y = tetrahedron(), with_up_axis(tetrahedron(), "y")
    np.testing.assert_array_equal(y.vertices[:, 1], z.vertices[:, 2])
    volumes = [trimesh.Trimesh(frame.vertices, frame.triangles).volume for frame in (z, y)]
    assert volumes == pytest.approx([1 / 6, 1 / 6], rel=1e-5)
