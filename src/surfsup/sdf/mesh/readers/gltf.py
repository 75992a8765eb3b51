"""glTF 2.0 and GLB: a scene of nodes with meshes, one file that holds everything."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from surfsup.sdf.mesh.readers.gltf_accessors import Accessors
from surfsup.sdf.mesh.readers.polygons import strip_triangles
from surfsup.sdf.mesh.readers.raw_mesh import RawMesh, UnreadableMeshError

DRACO = "KHR_draco_mesh_compression"
# Extensions that do not change the triangles, and those that this reader implements.
HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "MSFT_texture_", "KHR_xmp", "EXT_lights_")
IMPLEMENTED = {"KHR_mesh_quantization", DRACO, "EXT_meshopt_compression", "KHR_meshopt_compression"}
TRIANGLES, STRIP, FAN = 4, 5, 6


def read_gltf(content: bytes) -> RawMesh:
    """The triangles of the default scene of a GLB or glTF file, placed by its nodes.

    Raises:
        UnreadableMeshError: the file is damaged, keeps data elsewhere, or requires an extension that is not known.
    """
    return joined([part for _, part in read_parts(content)])


def read_parts(content: bytes) -> list[tuple[str, RawMesh]]:
    """The triangles of each node with a mesh in the default scene, placed, with the name of the node or of its mesh.

    Raises:
        UnreadableMeshError: as :func:`read_gltf`.
    """
    try:
        document, binary = chunks(content)
        refuse_extensions(document)
        with np.errstate(invalid="ignore", over="ignore"):  # numbers that are not finite are refused later
            return list(scene_parts(document, Accessors(document, binary)))
    except UnreadableMeshError:
        raise
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError, struct.error) as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise UnreadableMeshError(f"is damaged or not a glTF file ({reason}); export it again") from None


def chunks(content: bytes) -> tuple[dict[str, Any], bytes | None]:
    """The JSON part and the binary part of a GLB file, or the JSON of a glTF file.

    Raises:
        UnreadableMeshError: the version is not 2, or the file is cut off.
    """
    if content[:4] != b"glTF":
        return json.loads(content.decode("utf-8-sig")), None
    version, total = struct.unpack_from("<II", content, 4)
    if version != 2:
        raise UnreadableMeshError(f"is glTF of version {version}; convert it to version 2")
    if total > len(content):
        raise UnreadableMeshError(f"is damaged or cut off: it has {len(content)} of its {total} bytes; export it again")
    parts: dict[int, bytes] = {}
    at = 12
    while at + 8 <= total:
        size, kind = struct.unpack_from("<II", content, at)
        parts.setdefault(kind, content[at + 8 : at + 8 + size])
        at += 8 + size
    return json.loads(parts[0x4E4F534A].decode("utf-8")), parts.get(0x004E4942)


def refuse_extensions(document: dict[str, Any]) -> None:
    """Refuse a file that requires, or uses for its shape, what this reader does not know.

    Raises:
        UnreadableMeshError: naming the extension.
    """
    required = set(document.get("extensionsRequired", []))
    unknown = sorted(name for name in required - IMPLEMENTED if not name.startswith(HARMLESS))
    if "EXT_mesh_gpu_instancing" in document.get("extensionsUsed", []):
        unknown.append("EXT_mesh_gpu_instancing")
    if unknown:
        raise UnreadableMeshError(
            f"requires the glTF extension {unknown[0]}, which cannot be read; export it without, "
            "for instance by importing it into Blender and exporting it as GLB"
        )


def scene_parts(document: dict[str, Any], accessors: Accessors) -> Iterator[tuple[str, RawMesh]]:
    """The triangles of the meshes in the default scene, node by node."""
    read: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}
    for node, matrix in placed_nodes(document):
        if "mesh" not in node:
            continue
        remarks = ["has a skeleton; its shape is that without a pose"] if "skin" in node else []
        number = node["mesh"]
        mesh = document["meshes"][number]
        if number not in read:
            read[number] = [read_primitive(document, accessors, one) for one in mesh["primitives"]]
        vertices, faces, count = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
        for points, triangles in read[number]:
            if triangles.size and (triangles.min() < 0 or triangles.max() >= len(points)):
                raise UnreadableMeshError("is damaged: faces refer to vertices that do not exist; export it again")
            mirrored = np.linalg.det(matrix[:3, :3]) < 0
            vertices.append(points @ matrix[:3, :3].T + matrix[:3, 3])
            faces.append((triangles[:, ::-1] if mirrored else triangles) + count)
            count += len(points)
        name = str(node.get("name") or mesh.get("name") or f"mesh {number}")
        yield name, RawMesh(np.concatenate(vertices), np.concatenate(faces), remarks)


def joined(parts: list[RawMesh]) -> RawMesh:
    """Several meshes as one."""
    counts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    vertices = np.concatenate([np.empty((0, 3)), *(part.vertices for part in parts)])
    shifted = [part.faces + count for part, count in zip(parts, counts, strict=False)]
    faces = np.concatenate([np.empty((0, 3), np.int64), *shifted])
    return RawMesh(vertices, faces, sorted({remark for part in parts for remark in part.remarks}))


def placed_nodes(document: dict[str, Any]) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """The nodes of the default scene, each with its matrix (4, 4) in the scene.

    Raises:
        UnreadableMeshError: nodes form a loop.
    """
    nodes = document.get("nodes", [])
    scenes = document.get("scenes", [])
    if scenes:
        roots = scenes[document.get("scene", 0)].get("nodes", [])
    else:
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [number for number in range(len(nodes)) if number not in children]
    waiting = [(number, np.eye(4)) for number in reversed(roots)]
    visited = 0
    while waiting:
        number, parent = waiting.pop()
        visited += 1
        if visited > len(nodes):
            raise UnreadableMeshError("is damaged: a node belongs to several others or to itself; export it again")
        node = nodes[number]
        matrix = parent @ own_matrix(node)
        yield node, matrix
        waiting += [(child, matrix) for child in reversed(node.get("children", []))]


def own_matrix(node: dict[str, Any]) -> np.ndarray:
    """The matrix (4, 4) of a node relative to its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def read_primitive(
    document: dict[str, Any], accessors: Accessors, primitive: dict[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Points (V, 3) float64 and triangles (F, 3) of a primitive; none if it consists of points or lines."""
    mode = primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in primitive["attributes"]:
        return np.empty((0, 3)), np.empty((0, 3), np.int64)
    if DRACO in primitive.get("extensions", {}):
        return decode_draco(accessors, primitive["extensions"][DRACO])
    points = accessors.read(primitive["attributes"]["POSITION"]).astype(np.float64)
    if "indices" in primitive:
        indices = accessors.read(primitive["indices"])[:, 0].astype(np.int64)
    else:
        indices = np.arange(len(points))
    if mode == STRIP:
        return points, strip_triangles(indices)
    if mode == FAN:
        return points, np.stack([np.full(max(0, len(indices) - 2), indices[0]), indices[1:-1], indices[2:]], axis=1)
    return points, indices[: len(indices) // 3 * 3].reshape(-1, 3)


def decode_draco(accessors: Accessors, extension: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Points (V, 3) float64 and triangles (F, 3) of a primitive that Draco has compressed.

    Raises:
        UnreadableMeshError: the decoder is not installed, or the data are damaged.
    """
    try:
        import DracoPy
    except ImportError:
        raise UnreadableMeshError(
            f"is compressed by the extension {DRACO}; 'pip install dracopy' makes it readable, or decode it by "
            "importing it into Blender and exporting it as GLB without compression"
        ) from None
    try:
        mesh = DracoPy.decode(accessors.view(extension["bufferView"]))
        return np.array(mesh.points, dtype=np.float64).reshape(-1, 3), np.array(mesh.faces, np.int64).reshape(-1, 3)
    except UnreadableMeshError:
        raise
    except Exception as error:  # the decoder has exceptions of its own
        reason = " ".join(str(error).split())[:80]
        raise UnreadableMeshError(
            f"is damaged: what its extension {DRACO} compressed cannot be decoded ({reason}); export it again"
        ) from None
