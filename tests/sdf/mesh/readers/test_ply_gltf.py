"""PLY of any order and shape of elements, and glTF with its extensions, give the solid; what they miss is named."""

import base64
import json
import struct

import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.sdf import load_mesh

V = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (0, 1, 1)], float)
WEDGE = [(3, 2, 1, 0), (0, 1, 4), (3, 5, 2), (0, 4, 5, 3), (1, 2, 5, 4)]  # half a cube
CUBE = trimesh.creation.box((2, 2, 2))


def header(form, faces, extra="") -> str:
    return (
        f"ply\nformat {form} 1.0\ncomment made\nelement vertex 6\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {faces}\n{extra}property list uchar int vertex_indices\nend_header\n"
    )


def binary(order: str, form: str) -> bytes:
    faces = b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in WEDGE)
    return header(form, 5).encode() + V.astype(order + "f4").tobytes() + faces


TEXT = (
    header("ascii", 5)
    + "".join("{} {} {}\n".format(*v) for v in V)
    + "".join(f"{len(f)} {' '.join(map(str, f))}\n" for f in WEDGE)
)
COLORED = TEXT.replace("property list", "property uchar red\nproperty list")
COLORED = COLORED[: COLORED.index("4 3 2")] + "".join(f"7 {len(f)} {' '.join(map(str, f))}\n" for f in WEDGE)


def load(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return load_mesh(path, up="z")


@pytest.mark.parametrize(
    "content",
    [
        TEXT,
        TEXT.replace("\n", "\r\n"),
        COLORED,
        TEXT.replace("4 3 2 1 0", "4 3 2 1 0 9 1 1"),
        TEXT.replace("1 0\n", "1\n0 "),
        binary("<", "binary_little_endian"),
        binary(">", "binary_big_endian"),
    ],
)
def test_a_ply_with_triangles_and_quads_is_read(tmp_path, content):
    mesh = load(tmp_path, "wedge.ply", content)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.5)
    assert len(mesh.faces) == 8


def test_a_ply_of_triangle_strips_is_read(tmp_path):
    corners = CUBE.bounds[0] + 2 * np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
    words = "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\nproperty double z\n"
    words += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    words += "".join("{} {} {}\n".format(*c) for c in corners)
    strips = "0 3 1 2 5 6 4 7 0 3 -1 3 7 2 6 -1 1 5 0 4"
    words += f"{len(strips.split())} {strips}\n"
    mesh = load(tmp_path, "cube.ply", words)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(8)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (TEXT[:-9], "ends within its 5 elements 'face'"),
        (binary("<", "binary_little_endian")[:-3], "ends within its 5 elements 'face'"),
        (TEXT.replace("element vertex 6", "element vertex 60000000"), "ends within its 60000000 elements"),
        (TEXT.replace("end_header", "end"), "its header has no end"),
        (TEXT.replace("property float z", "property float w"), "no property z"),
        (TEXT.replace("ascii", "morse"), "names no known format"),
        (TEXT.replace("vertex 6", "vertex -6"), "negative number"),
    ],
)
def test_a_damaged_ply_is_refused(tmp_path, content, message):
    with pytest.raises(InputError, match=message):
        load(tmp_path, "wedge.ply", content)


def glb(document, data: bytes) -> bytes:
    text = json.dumps({"asset": {"version": "2.0"}, **document}).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    size = 28 + len(text) + len(data)
    head = struct.pack("<4sII", b"glTF", 2, size)
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data


def cube_document(points: np.ndarray, component: int, normalized=False, nodes=({"mesh": 0},), **more):
    """A document with a cube whose points are ``points``, and its data."""
    indices = CUBE.faces.astype("<u2").tobytes()
    data = points.tobytes() + indices
    document = {
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": list(nodes),
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": points.nbytes, "byteStride": points.strides[0]},
            {"buffer": 0, "byteOffset": points.nbytes, "byteLength": len(indices)},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": component, "count": 8, "type": "VEC3", "normalized": normalized},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        **more,
    }
    return document, data


FLOATS = CUBE.vertices.astype("<f4")
TWO = (
    {"mesh": 0, "translation": [-0.25, 0, 0.15], "scale": [0.15, 0.15, 0.15]},
    {"mesh": 0, "translation": [0.25, 0, 0.1], "scale": [-0.1, 0.1, 0.1]},
)


def padded(values: np.ndarray) -> np.ndarray:
    """Rows of four components, as quantized positions are stored."""
    return np.concatenate([values, np.zeros((len(values), 1), values.dtype)], axis=1)


@pytest.mark.parametrize(
    ("points", "component", "normalized", "scale"),
    [
        (FLOATS, 5126, False, 1),
        (padded((CUBE.vertices * 32767).astype("<i2")), 5122, True, 1),
        (padded((CUBE.vertices * 127).astype("i1")), 5120, True, 1),
        (padded((CUBE.vertices * 100).astype("<i2")), 5122, False, 100),
    ],
)
def test_quantized_positions_and_mirrored_nodes_are_placed(tmp_path, points, component, normalized, scale):
    required = {} if component == 5126 else {"extensionsRequired": ["KHR_mesh_quantization"]}
    mesh = load(tmp_path, "two.glb", glb(*cube_document(points, component, normalized, TWO, **required)))
    if scale == 1:
        np.testing.assert_allclose(mesh.extents, (0.75, 0.3, 0.3), rtol=1e-6)
    assert mesh.volume == pytest.approx((0.3**3 + 0.2**3) * scale**3)


def test_a_gltf_with_its_data_inside_is_read_and_one_with_other_files_names_them(tmp_path):
    document, data = cube_document(FLOATS, 5126)
    document = {"asset": {"version": "2.0"}, **document}
    document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    assert load(tmp_path, "cube.gltf", json.dumps(document)).volume == pytest.approx(8)
    document["buffers"][0]["uri"] = "../secret.bin"
    with pytest.raises(InputError, match=r"another file \('../secret.bin'\), which is not opened; join them by"):
        load(tmp_path, "cube.gltf", json.dumps(document))


def with_draco(content: bytes):
    document, data = cube_document(FLOATS, 5126, nodes=TWO)
    document["meshes"].append(json.loads(json.dumps(document["meshes"][0])))
    document["nodes"][1]["mesh"] = 1
    document["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content)})
    document["buffers"][0]["byteLength"] += len(content)
    extension = {"KHR_draco_mesh_compression": {"bufferView": 2, "attributes": {"POSITION": 0}}}
    document["meshes"][1]["primitives"][0]["extensions"] = extension
    document["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return glb(document, data + content)


def test_a_part_compressed_by_draco_is_decoded(tmp_path):
    draco = pytest.importorskip("DracoPy")
    content = draco.encode(CUBE.vertices.astype("f4"), CUBE.faces.astype("u4"), quantization_bits=14)
    mesh = load(tmp_path, "two.glb", with_draco(content))
    assert mesh.volume == pytest.approx(0.3**3 + 0.2**3, rel=1e-3)
    with pytest.raises(InputError, match="KHR_draco_mesh_compression compressed cannot be decoded"):
        load(tmp_path, "broken.glb", with_draco(content[:20]))


def meshopt():
    document, data = cube_document(FLOATS, 5126)
    document["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {"buffer": 0}}
    return glb(document, data)


def looped():
    return glb(*cube_document(FLOATS, 5126, nodes=({"mesh": 0, "children": [0]},)))


def beyond():
    document, data = cube_document(FLOATS, 5126)
    document["accessors"][0]["count"] = 4_000_000_000
    return glb(document, data)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (meshopt(), "extension EXT_meshopt_compression, which cannot be decoded; decode it by 'gltfpack"),
        (
            glb(*cube_document(FLOATS, 5126, extensionsRequired=["ACME_cubes"])),
            "requires the glTF extension ACME_cubes",
        ),
        (looped(), "belongs to several others or to itself"),
        (beyond(), "reaches beyond its view"),
        (b"glTF" + struct.pack("<II", 1, 20) + bytes(8), "glTF of version 1"),
    ],
)
def test_a_gltf_that_cannot_be_read_is_refused_by_name(tmp_path, content, message):
    with pytest.raises(InputError, match=message):
        load(tmp_path, "cube.glb", content)
