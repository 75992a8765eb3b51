import numpy as np
import pytest
import trimesh

from surfsup.design.shape_files import make_watertight, write_shape
from surfsup.errors import InputError
from surfsup.sdf import Bowl


def test_files_are_watertight_and_in_the_units_of_their_formats(tmp_path, monkeypatch):
    monkeypatch.setattr("surfsup.design.shape_files.RESOLUTION", 48)
    stl, glb, obj = write_shape(Bowl(0.1, 0.03), tmp_path, "bowl")
    for path, units_per_meter, up in ((stl, 1000, 2), (glb, 1, 1), (obj, 1, 2)):
        mesh = trimesh.load(path, force="mesh")
        assert mesh.is_watertight and mesh.volume > 0
        assert np.ptp(mesh.vertices, axis=0).max() == pytest.approx(0.28 * units_per_meter, rel=0.01)
        assert mesh.bounds[1, up] == pytest.approx(0.02 * units_per_meter, rel=0.05)


def test_vertices_that_a_reader_would_merge_are_merged():
    box = trimesh.creation.box()
    vertices = np.vstack([box.vertices, box.vertices[0] + [1e-9, 0.0, 0.0]])
    first_corner = np.argwhere(box.faces == 0)
    faces = box.faces.copy()
    faces[tuple(first_corner[0])] = 8
    assert make_watertight(trimesh.Trimesh(vertices, faces, process=False), "a box").is_watertight


def test_bodies_smaller_than_a_particle_are_removed():
    box, small = trimesh.creation.box(extents=(0.2, 0.2, 0.2)), trimesh.creation.box(extents=(0.01, 0.01, 0.01))
    small.apply_translation((0.0, 0.0, 0.3))
    assert make_watertight(trimesh.util.concatenate([box, small]), "two boxes").volume == pytest.approx(0.008)


def test_an_open_mesh_is_refused():
    open_mesh = trimesh.creation.box().submesh([range(6)], append=True)
    with pytest.raises(InputError, match="it cannot be printed"):
        make_watertight(open_mesh, "half a box")
