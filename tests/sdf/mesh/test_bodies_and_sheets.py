"""Bodies are oriented one by one, shared faces vanish, concave polygons keep their area, sheets are no solids."""

import warnings

import numpy as np
import pytest
import torch
import trimesh

from surfsup.errors import InputError
from surfsup.scene import load_mesh as load_surface
from surfsup.sdf import MeshSurface, MeshWarning, load_mesh
from surfsup.sdf.mesh.query import MeshQuery
from surfsup.sdf.mesh.readers.polygons import triangulate

BOX, BALL = trimesh.creation.box((0.3, 0.3, 0.3)), trimesh.creation.icosphere(2, 1.0)


@pytest.fixture(autouse=True)
def strict():
    with warnings.catch_warnings():
        warnings.simplefilter("error", MeshWarning)
        yield


def moved(mesh, x=0.0, scale=1.0, inward=False):
    copy = mesh.copy()
    copy.apply_scale(scale)
    copy.apply_translation((x, 0, 0))
    if inward:
        copy.invert()
    return copy


def written(folder, *meshes):
    path = folder / "mesh.ply"
    trimesh.util.concatenate(meshes).export(path)
    return path


@pytest.mark.parametrize("distance", [0.5, 0.2])
def test_one_of_two_bodies_inside_out_is_turned(tmp_path, distance):
    path = written(tmp_path, BOX, moved(BOX, distance, inward=True))
    with pytest.warns(MeshWarning, match="1 of 2 bodies inside out"):
        mesh = load_mesh(path)
    assert mesh.volume == pytest.approx(2 * BOX.volume, rel=1e-5)


def test_cavities_stay_also_with_a_body_inside_and_if_all_is_inside_out(tmp_path):
    nested = [moved(BALL), moved(BALL, scale=0.7, inward=True), moved(BALL, scale=0.4)]
    volume = BALL.volume * (1 - 0.7**3 + 0.4**3)
    assert load_mesh(written(tmp_path, *nested)).volume == pytest.approx(volume, rel=1e-5)
    for mesh in nested:
        mesh.invert()
    with pytest.warns(MeshWarning, match="is inside out"):
        assert load_mesh(written(tmp_path, *nested)).volume == pytest.approx(volume, rel=1e-5)


def grid_of_cells(count: int) -> str:
    """OBJ text of a cube of hexahedra that share vertices, with all their faces."""
    lines = [f"v {x} {y} {z}" for x in range(count + 1) for y in range(count + 1) for z in range(count + 1)]
    sides = [
        "000 010 110 100",
        "001 101 111 011",
        "000 100 101 001",
        "100 110 111 101",
        "110 010 011 111",
        "010 000 001 011",
    ]
    for cell in np.ndindex(count, count, count):
        for side in sides:
            corners = [np.add(cell, [int(digit) for digit in corner]) for corner in side.split()]
            lines.append("f " + " ".join(str(np.ravel_multi_index(c, [count + 1] * 3) + 1) for c in corners))
    return "\n".join(lines)


def test_bodies_that_share_faces_are_one_solid_without_inner_walls(tmp_path):
    path = tmp_path / "grid.obj"
    path.write_text(grid_of_cells(4))
    mesh = load_mesh(path)
    assert mesh.is_watertight
    assert mesh.area == pytest.approx(6 * 16)
    assert mesh.volume == pytest.approx(64)


GUTTER = [(0, 0), (12, 0), (12, 8), (11, 8), (11, 1), (1, 1), (1, 8), (0, 8)]


@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_a_concave_polygon_keeps_its_area_and_all_of_its_corners(tmp_path, tilt):
    turn = trimesh.transformations.euler_matrix(tilt, 2 * tilt, 0)[:3, :3]
    outline = np.insert(np.array([*GUTTER[:1], (6, 0), *GUTTER[1:]], float), 2, 3.0, axis=1)  # one on a straight edge
    triangles = triangulate(outline @ turn.T, np.array([9, 2]), np.array([*range(9), 0, 1]))
    corners = (outline @ turn.T)[triangles]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    assert len(triangles) == 7
    assert set(triangles.ravel().tolist()) == set(range(9))
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(26)
    assert np.linalg.norm(areas.sum(axis=0)) == pytest.approx(26)


def test_the_open_end_of_a_gutter_is_open(tmp_path):
    lines = [f"v {x / 20 - 0.3} {y} {z / 20}" for y in (-0.3, 0.3) for x, z in GUTTER]
    lines += [f"f {i + 9} {(i + 1) % 8 + 9} {(i + 1) % 8 + 1} {i + 1}" for i in range(8)]
    lines += ["f 1 2 3 4 5 6 7 8", "f 16 15 14 13 12 11 10 9"]
    (tmp_path / "gutter.obj").write_text("\n".join(lines))
    mesh = load_mesh(tmp_path / "gutter.obj")
    assert mesh.is_watertight
    distance = MeshSurface(mesh, exact=True).distance(torch.tensor([[0.0, 0.3, 0.2], [0.0, 0.3, 0.03]]))
    torch.testing.assert_close(distance, torch.tensor([0.15, 0.0]), atol=1e-6, rtol=0)


def cup(folder):
    """A cup of a single sheet, open above, 0.4 m wide and high."""
    tube = trimesh.creation.cylinder(0.2, 0.4, sections=48).subdivide()
    open_above = tube.triangles_center[:, 2] < 0.2 - 1e-6
    path = folder / "cup.stl"
    trimesh.Trimesh(tube.vertices, tube.faces[open_above], process=False).export(path)
    return path


def test_a_sheet_is_refused_and_thickened_on_request(tmp_path):
    path = cup(tmp_path)
    with pytest.raises(InputError, match=r"open sheet without thickness.*give it walls with --thicken 0.03"):
        load_mesh(path)
    surface = load_surface(path, fit=0.4, thicken=0.03)
    np.testing.assert_allclose(surface.bounds()[:, 2], [0, 0.4], atol=2e-3)
    middle, wall = torch.tensor([[0.0, 0.0, 0.2]]), torch.tensor([[0.0, 0.0, 0.015]])
    assert surface.distance(middle).item() > 0.1
    assert surface.distance(wall).item() == pytest.approx(-0.015, abs=3e-3)


def test_thickening_a_closed_mesh_or_by_too_little_is_refused(tmp_path):
    path = written(tmp_path, BOX)
    with pytest.raises(InputError, match="no sheet to thicken"):
        load_surface(path, thicken=0.03)
    with pytest.raises(InputError, match="too thin for a mesh"):
        load_surface(cup(tmp_path), thicken=1e-4)
    with pytest.raises(InputError, match="must exceed thicken"):
        load_surface(cup(tmp_path), fit=0.02, thicken=0.03)


def test_a_small_sheet_beside_a_solid_is_left_out_with_a_warning(tmp_path):
    leaf = trimesh.Trimesh([(0.5, 0, 0), (0.6, 0, 0), (0.6, 0.1, 0.01)], [(0, 1, 2)], process=False)
    with pytest.warns(MeshWarning, match="sheets without thickness.*left out: water passes"):
        mesh = load_mesh(written(tmp_path, BOX, leaf))
    assert mesh.is_watertight
    assert mesh.extents[0] == pytest.approx(0.3)


def test_the_normal_at_an_edge_is_the_mean_of_its_faces():
    query = MeshQuery(BOX.vertices, BOX.faces)
    points = np.array([[0.15, 0.15, 0.03], [0.15, -0.15, 0.07], [0.02, 0.15, 0.15]])
    _, face, closest = query.nearest(points)
    expected = np.array([[1, 1, 0], [1, -1, 0], [0, 1, 1]]) / np.sqrt(2)
    np.testing.assert_allclose(query.surface_normal(face, closest), expected, atol=1e-9)
