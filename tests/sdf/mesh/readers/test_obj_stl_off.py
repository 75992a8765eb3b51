"""Every spelling of a box that some common reader takes gives the box; what cannot be read is named."""

import re
import struct
import warnings

import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.sdf import MeshWarning, load_mesh

V = [(-0.3, -0.3, 0), (0.3, -0.3, 0), (0.3, 0.3, 0), (-0.3, 0.3, 0)]
V += [(x, y, 0.4) for x, y, _ in V]
F = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
OBJ = "".join("v {} {} {}\n".format(*v) for v in V) + "".join("f {} {} {} {}\n".format(*(i + 1 for i in f)) for f in F)
SOUP = trimesh.Trimesh(V, [t for a, b, c, d in F for t in ((a, b, c), (a, c, d))], process=False)
STL = SOUP.export(file_type="stl")
OFF = "OFF\n8 6 0\n" + "".join("{} {} {}\n".format(*v) for v in V) + "".join("4 {} {} {} {}\n".format(*f) for f in F)


def solid(name="box", shift=0.0) -> str:
    lines = [f"solid {name}"]
    for triangle in SOUP.triangles:
        corners = ["  vertex {} {} {}".format(*(corner + np.array([shift, 0, 0]))) for corner in triangle]
        lines += [" facet normal 0 0 0", "  outer loop", *corners, "  endloop", " endfacet"]
    return "\n".join(lines) + "\n"


def read(tmp_path, name, content, warning=None):
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", MeshWarning)
        mesh = load_mesh(path)
    texts = [str(one.message) for one in caught]
    assert len(texts) == (warning is not None)
    assert warning is None or warning in texts[0]
    return mesh


def is_the_box(mesh) -> bool:
    return (
        mesh.is_watertight
        and mesh.volume == pytest.approx(0.144, rel=1e-5)
        and np.allclose(mesh.bounds, [(-0.3, -0.3, 0), (0.3, 0.3, 0.4)], atol=1e-6)
    )


@pytest.mark.parametrize(
    "content",
    [
        OBJ,
        OBJ.replace(" ", "\t"),
        OBJ.upper(),
        "\n".join("   " + line for line in OBJ.split("\n")),
        OBJ.replace("\n", " # a comment\n"),
        OBJ.replace("\n", "\r"),
        OBJ.replace("\n", "\r\n"),
        OBJ.replace("f 4 3 2 1", "f 4 3 \\\n2 1"),
        OBJ.replace("0.", "0,"),
        OBJ.replace("0.3", "3.0D-01"),
        "mtllib none.mtl\nusemtl a\nvt 0 0\nvn 0 0 1\n" + OBJ.replace("f 4 3 2 1", "f 4/1/1 3//1 2/1 1"),
        OBJ.replace("0.4\n", "0.4 1 0.5 0\n"),
        "l 1 2\np 3\ng a b\ns off\n" + OBJ,
        "".join(sorted(OBJ.splitlines(keepends=True), key=lambda line: line[0])),  # faces before vertices
        b"\xef\xbb\xbf" + OBJ.encode(),
        OBJ.encode("utf-16"),
        b"# Gef\xe4\xdf\n" + OBJ.encode(),
    ],
)
def test_an_obj_is_read_however_it_is_written(tmp_path, content):
    mesh = read(tmp_path, "box.obj", content)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.144)


def test_relative_indices_count_from_the_line_that_they_are_in(tmp_path):
    def pillar(x, height):
        corners = [
            (x + i, j, k) for k in (0, height) for i, j in ((-0.15, -0.15), (0.15, -0.15), (0.15, 0.15), (-0.15, 0.15))
        ]
        return "".join("v {} {} {}\n".format(*c) for c in corners) + "".join(
            "f {} {} {} {}\n".format(*(i - 8 for i in f)) for f in F
        )

    mesh = read(tmp_path, "pillars.obj", pillar(-0.25, 0.3) + pillar(0.25, 0.5))
    np.testing.assert_allclose(mesh.bounds, [(-0.4, -0.15, 0), (0.4, 0.15, 0.5)])
    assert mesh.volume == pytest.approx(0.09 * 0.8)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("box.stl", STL),
        ("box.stl", b"solid made by a program" + STL[23:]),
        ("box.stl", solid() + "endsolid box\n"),
        ("box.stl", solid("solid vertex")),
        ("box.stl", solid().replace("0.", "0,")),
        ("box.stl", solid().upper()),
        ("box.stl", solid().replace("normal 0 0 0", "normal nan nan nan")),
        ("box.off", OFF),
        ("box.off", OFF.replace("\n", " ", 1)),
        ("box.off", OFF[4:]),
        ("box.off", "# made\n" + OFF.replace("\n4 3", " # and\n4 3")),
        ("box.off", OFF.replace("\n4 ", "\n4\n")),
        ("box.off", "C" + re.sub(r"^(-?0.3 .*)$", r"\1 1 0 0 1", OFF, flags=re.MULTILINE)),
        ("box.off", "ST" + re.sub(r"^(-?0.3 .*)$", r"\1 0.5 0.5", OFF, flags=re.MULTILINE)),
        ("box.off", "N" + re.sub(r"^(-?0.3 .*)$", r"\1 0 0 1", OFF, flags=re.MULTILINE)),
        ("box.off", OFF.replace("4 4 5 6 7", "4 4 5 6 7 255 0 0")),
        ("noext", OBJ),
        ("box.txt", OFF),
    ],
)
def test_stl_and_off_are_read_however_they_are_written(tmp_path, name, content):
    assert is_the_box(read(tmp_path, name, content))


@pytest.mark.parametrize("end", ["endsolid left\n", "end solid\n", ""])
def test_every_solid_of_a_text_stl_is_read(tmp_path, end):
    mesh = read(tmp_path, "two.stl", solid("left", -1) + end + solid("right", 1) + end)
    assert mesh.volume == pytest.approx(0.288)
    assert mesh.extents[0] == pytest.approx(2.6)


@pytest.mark.parametrize(
    ("name", "content", "warning"),
    [
        ("box.stl", STL[:80] + struct.pack("<I", 0) + STL[84:], "announces 0 triangles and contains 12"),
        ("box.stl", STL + bytes(10), "10 bytes after its last triangle"),
        ("box.stl", OFF, "format OFF by its content"),
        ("box.ply", STL, "format STL by its content"),
        ("box.obj", OFF, "format OFF by its content"),
        ("box.obj", OBJ.replace("0.4\n", "0.4 2.0\n"), "weight, which was ignored"),
        ("box.obj", "cstype bezier\n" + OBJ, "free-form curves or surfaces (cstype), which were left out"),
    ],
)
def test_what_is_corrected_or_skipped_is_said(tmp_path, name, content, warning):
    assert is_the_box(read(tmp_path, name, content, warning))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", OBJ.replace("f 4 3 2 1", "f 0 3 2 1"), "index 0, but OBJ counts from 1"),
        ("a.obj", OBJ.replace("f 4 3 2 1", "f 99 3 2 1"), "refers to vertex 99, but there are 8"),
        ("a.obj", "f -1 -2 -3\n" + OBJ, "before the first vertex"),
        ("a.obj", OBJ.replace("f 4 3 2 1", "f 4 three 2 1"), "not a list of indices ('f 4 three 2 1')"),
        ("a.obj", "v 1 2\n" + OBJ, "not three numbers ('v 1 2')"),
        ("a.obj", "v 0 0 0\ncstype bezier\nsurf 0 1 0 1 1\n", "free-form curves or surfaces"),
        ("a.stl", STL[:-30], "announces 12 triangles and has room for 11"),
        ("a.stl", solid()[:-100], "facets have"),
        ("a.off", OFF.replace("OFF", "4OFF", 1), "four or more dimensions"),
        ("a.off", OFF.replace("OFF", "OFF BINARY", 1), "binary OFF"),
        ("a.off", OFF[:-20], "is damaged or not an OFF file"),
        ("a.off", OFF.replace("0.3 0.3 0\n", "0.3 0.3\n", 1), "its vertex 2 has 2 coordinates"),
        ("a.off", OFF.replace("\n8 6 0\n", " 8 6 0 ") + " 7", "1 numbers more than its counts announce"),
        ("a.obj.gz", b"\x1f\x8b\x08 and so on", "unpack it by gunzip"),
        ("a.3mf", b"PK\x03\x04 and so on", "ZIP archive"),
        ("a.step", b"ISO-10303-21;", "STEP file of a CAD program; export the part as STL"),
        ("a.fbx", b"Kaydara FBX Binary  ", "Blender"),
        ("a.stl", b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
        ("a.obj", b"<!DOCTYPE html><html></html>", "web page"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError) as error:
        load_mesh(path)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_coordinates_are_read_in_double_precision(tmp_path):
    far = np.array([4.5e5, 5.3e6, 200.0])
    mesh = read(tmp_path, "utm.obj", SOUP.copy().apply_translation(far).export(file_type="obj", digits=9))
    np.testing.assert_allclose(mesh.bounds[0], far + SOUP.bounds[0], atol=1e-8, rtol=0)
    assert len(mesh.vertices) == 8


@pytest.mark.parametrize("scale", [1e-12, 1e-7, 1e12, 1e20])
def test_any_unit_of_length_will_do(tmp_path, scale):
    ball = trimesh.creation.icosphere(3)
    lines = ["v {!r} {!r} {!r}".format(*map(float, v * scale)) for v in ball.vertices]
    lines += ["f {} {} {}".format(*(f + 1)) for f in ball.faces]
    mesh = read(tmp_path, "ball.obj", "\n".join(lines))
    assert len(mesh.faces) == len(ball.faces)
    assert mesh.extents[2] == pytest.approx(2 * scale)
