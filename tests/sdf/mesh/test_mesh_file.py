"""Untrusted mesh files: read, repaired with a warning, or refused with one line."""

import io
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from surfsup.errors import InputError
from surfsup.sdf import MeshSurface, MeshWarning, fit_mesh, load_mesh

BOX = trimesh.creation.box((0.4, 0.5, 0.6))
BALL = trimesh.creation.icosphere(subdivisions=2, radius=0.3)


@pytest.fixture(autouse=True)
def strict():
    """A warning that a test does not expect is a failure."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", MeshWarning)
        yield


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def exported(folder: Path, mesh, name="mesh.obj") -> Path:
    path = folder / name
    mesh.export(path)
    return path


def refusal(path, **options) -> str:
    with pytest.raises(InputError) as error:
        load_mesh(path, **options)
    line = str(error.value)
    assert "\n" not in line
    assert str(path) in line
    return line


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "off", "STL", "OBJ"])
def test_every_format_gives_the_same_solid(tmp_path, suffix):
    content = BOX.export(file_type=suffix.lower())
    mesh = load_mesh(written(tmp_path, f"box.{suffix}", content))
    assert mesh.is_watertight
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)
    np.testing.assert_allclose(mesh.extents, (0.4, 0.5, 0.6), rtol=1e-5)
    assert mesh.volume == pytest.approx(0.12, rel=1e-5)


def test_glb_is_y_up_by_its_specification_and_rotated(tmp_path):
    path = exported(tmp_path, BOX, "box.glb")
    np.testing.assert_allclose(load_mesh(path).extents, (0.4, 0.6, 0.5), rtol=1e-5)
    np.testing.assert_allclose(load_mesh(path, up="z").extents, (0.4, 0.5, 0.6), rtol=1e-5)


def test_other_formats_are_rotated_on_request(tmp_path):
    tall = BOX.copy()
    tall.apply_translation([0, 1, 0])
    path = exported(tmp_path, tall)
    mesh = load_mesh(path, up="y")
    np.testing.assert_allclose(mesh.bounds[:, 2], (0.75, 1.25), rtol=1e-5)
    assert mesh.volume > 0  # rotated, not mirrored
    np.testing.assert_allclose(load_mesh(path).bounds[:, 1], (0.75, 1.25), rtol=1e-5)
    assert "up is 'x'" in refusal(path, up="x")


def test_the_objects_of_a_scene_are_placed_and_joined(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(BOX)
    scene.add_geometry(BALL, transform=trimesh.transformations.translation_matrix([2, 0, 0]))
    mesh = load_mesh(exported(tmp_path, scene, "scene.glb"), up="z")
    np.testing.assert_allclose(mesh.bounds[1, 0], 2.3, rtol=1e-5)
    assert mesh.volume == pytest.approx(BOX.volume + BALL.volume, rel=1e-4)


def test_polygons_become_triangles(tmp_path):
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    quads = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    lines = ["v {} {} {}".format(*c) for c in corners] + ["f {} {} {} {}".format(*q) for q in quads]
    mesh = load_mesh(written(tmp_path, "cube.obj", "\n".join(lines)))
    assert len(mesh.faces) == 12
    assert mesh.volume == pytest.approx(1.0)


def test_superfluous_elements_are_removed(tmp_path):
    lines = BOX.export(file_type="obj").splitlines()
    faces = [line for line in lines if line.startswith("f")]
    loose = ["v 9 9 9", "f 1 1 2", faces[0], faces[3]]
    mesh = load_mesh(written(tmp_path, "box.obj", "\n".join(lines + loose)))
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)


def test_nothing_but_the_named_file_is_opened(tmp_path, monkeypatch):
    named = written(tmp_path, "box.obj", "mtllib secret.mtl\nusemtl a\n" + BOX.export(file_type="obj"))
    written(tmp_path, "secret.mtl", "newmtl a\nmap_Kd secret.png\n")
    opened = []
    read = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: opened.append(path.name) or read(path))
    monkeypatch.setattr("builtins.open", lambda *a, **k: pytest.fail(f"opened {a}"))
    load_mesh(named)
    assert opened == ["box.obj"]


def test_a_mesh_with_holes_is_used_with_a_warning(tmp_path):
    ball = trimesh.Trimesh(BALL.vertices, BALL.faces[10:], process=False)
    with pytest.warns(MeshWarning, match="holes"):
        mesh = load_mesh(exported(tmp_path, ball))
    inside = MeshSurface(mesh, exact=True).distance(torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 0.4]])) < 0
    assert inside.tolist() == [True, False]


def test_flipped_faces_are_flipped_back_with_a_warning(tmp_path):
    faces = BALL.faces.copy()
    faces[::7] = faces[::7, ::-1]
    with pytest.warns(MeshWarning, match="oriented against their neighbors, 46 of 320"):
        mesh = load_mesh(exported(tmp_path, trimesh.Trimesh(BALL.vertices, faces, process=False)))
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(BALL.volume, rel=1e-5)


def test_an_inside_out_mesh_is_flipped_with_a_warning(tmp_path):
    ball = BALL.copy()
    ball.invert()
    with pytest.warns(MeshWarning, match="inside out"):
        assert load_mesh(exported(tmp_path, ball)).volume == pytest.approx(BALL.volume, rel=1e-5)


def test_a_cavity_stays_a_cavity(tmp_path):
    hole = BALL.copy()
    hole.apply_scale(0.5)
    hole.invert()
    mesh = load_mesh(exported(tmp_path, trimesh.util.concatenate([BALL, hole])))
    assert mesh.volume == pytest.approx(BALL.volume * (1 - 0.125), rel=1e-4)


def obj(vertices, faces) -> str:
    lines = ["v {} {} {}".format(*v) for v in vertices] + ["f {} {} {}".format(*f) for f in faces]
    return "\n".join(lines) + "\n"


TRIANGLE = obj([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 2, 3)])
FLAT = obj([(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1), (2, 2, 1)], [(1, 2, 3), (1, 3, 4), (3, 2, 5)])
BENT = obj(
    [(x, y, 0.05 * x * y) for x in range(4) for y in range(4)],
    [(i, i + 4, i + 1) for i in (1, 2, 3, 5, 6, 7)] + [(i + 1, i + 4, i + 5) for i in (1, 2, 3, 5, 6, 7)],
)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("text.obj", "Dear all,\nplease find the mesh attached.\n", "no triangles|damaged"),
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no triangles|damaged"),
        ("empty.obj", "", "empty"),
        (
            "nan.obj",
            obj([(0, 0, 0), (1, 0, 0), (0, "nan", 0), (0, 0, 1)], [(1, 3, 2), (1, 2, 4)]),
            "not finite",
        ),
        (
            "inf.obj",
            obj([(0, 0, 0), (1, 0, 0), (0, "inf", 0), (0, 0, 1)], [(1, 3, 2), (1, 2, 4)]),
            "not finite",
        ),
        ("index.obj", obj([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 2, 30)]), "damaged"),
        ("triangle.obj", TRIANGLE, "flat"),
        ("flat.obj", FLAT, "flat"),
        ("thread.obj", obj([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(1, 2, 3)]), "flat"),
        ("bent.obj", BENT, "open sheet"),
        ("text.stl", "not a mesh", "damaged|no triangles"),
        ("text.ply", "not a mesh", "damaged|no triangles"),
        ("text.off", "not a mesh", "damaged|no triangles"),
        ("text.glb", "not a mesh", "damaged|no triangles"),
        ("cut.stl", BALL.export(file_type="stl")[:-777], "no triangles"),
        ("cut.ply", BALL.export(file_type="ply")[:-777], "damaged"),
        ("cut.glb", trimesh.Scene(BALL).export(file_type="glb")[:-777], "damaged"),
        ("head.stl", bytes(80) + struct.pack("<I", 2**31), "no triangles"),
        ("zeros.stl", bytes(4096), "damaged|no triangles"),
    ],
)
def test_meshes_without_an_inside_and_unreadable_files_are_refused(tmp_path, name, content, message):
    line = refusal(written(tmp_path, name, content))
    assert any(words in line for words in message.split("|"))


def test_a_truncated_file_raises_nothing_but_input_errors(tmp_path):
    for suffix in ("obj", "stl", "ply", "off", "glb"):
        whole = trimesh.Scene(BALL).export(file_type="glb") if suffix == "glb" else BALL.export(file_type=suffix)
        whole = whole.encode() if isinstance(whole, str) else whole
        for cut in np.linspace(1, len(whole) - 1, 12).astype(int):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", MeshWarning)
                try:
                    load_mesh(written(tmp_path, f"cut.{suffix}", whole[:cut]))
                except InputError as error:
                    assert "\n" not in str(error)


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    assert "No such file" in refusal(tmp_path / "missing.obj")
    (tmp_path / "folder.obj").mkdir()
    assert "directory" in refusal(tmp_path / "folder.obj")
    assert "No such file" in refusal("https:/example.org/mesh.obj")


@pytest.mark.parametrize("name", ["mesh.fbx", "mesh", "mesh.zip", "mesh.pkl"])
def test_an_unknown_format_raises_an_error_that_lists_the_known_ones(tmp_path, name):
    assert ".obj, .stl, .ply, .off, .glb or .gltf" in refusal(written(tmp_path, name, "x"))


def test_a_point_cloud_has_no_triangles(tmp_path):
    cloud = io.BytesIO(trimesh.PointCloud(BALL.vertices).export(file_type="ply")).getvalue()
    assert "triangles" in refusal(written(tmp_path, "cloud.ply", cloud))


@pytest.mark.parametrize("extent", [0.8, 2.0])
def test_fitting_scales_centers_and_stands_on_the_floor(extent):
    moved = BOX.copy()
    moved.apply_translation([3.0, -2.0, 7.0])
    before = moved.vertices.copy()
    mesh, scale = fit_mesh(moved, extent)
    assert scale == pytest.approx(extent / 0.6)
    np.testing.assert_allclose(mesh.extents, np.array([0.4, 0.5, 0.6]) * scale)
    np.testing.assert_allclose(mesh.bounds.mean(axis=0)[:2], 0, atol=1e-12)
    assert mesh.bounds[0, 2] == pytest.approx(0, abs=1e-12)
    np.testing.assert_array_equal(moved.vertices, before)


@pytest.mark.parametrize("extent", [0.0, -1.0, float("nan"), float("inf")])
def test_fitting_to_an_invalid_extent_is_refused(extent):
    with pytest.raises(InputError, match="largest extent"):
        fit_mesh(BOX, extent)


def test_a_file_too_large_for_the_memory_is_refused_before_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "scan.stl"
    with path.open("wb") as file:
        file.truncate(2_000_000_000)  # takes no place on the disk
    monkeypatch.setattr("surfsup.sdf.mesh.mesh_file.available_memory", lambda: 16 * 10**9)
    with pytest.raises(InputError, match=r"has 2 GB, and reading it takes some 60 GB .* this machine has 16; reduce"):
        load_mesh(path)
