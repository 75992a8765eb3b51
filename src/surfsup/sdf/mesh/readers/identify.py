"""Which format a file has: its content decides, not its name."""

from __future__ import annotations

import re
from collections.abc import Callable

from surfsup.sdf.mesh.readers.gltf import read_gltf
from surfsup.sdf.mesh.readers.obj import read_obj
from surfsup.sdf.mesh.readers.off import HEADER as OFF_HEADER
from surfsup.sdf.mesh.readers.off import read_off
from surfsup.sdf.mesh.readers.ply import read_ply
from surfsup.sdf.mesh.readers.raw_mesh import RawMesh, UnreadableMeshError
from surfsup.sdf.mesh.readers.stl import HEADER as STL_HEADER
from surfsup.sdf.mesh.readers.stl import TRIANGLE, announced, is_text, read_stl
from surfsup.sdf.mesh.readers.text import decode

READERS: dict[str, Callable[[bytes], RawMesh]] = {
    "obj": read_obj,
    "stl": read_stl,
    "ply": read_ply,
    "off": read_off,
    "glb": read_gltf,
    "gltf": read_gltf,
}
SAMPLE = 65_536  # bytes that decide
OBJ_LINE = re.compile(r"^[ \t]*[vf][ \t]+-?[\d.]", re.IGNORECASE | re.MULTILINE)
# What other files begin with, what they are, and what to do.
FOREIGN = (
    (b"\x1f\x8b", "is compressed by gzip; unpack it by gunzip"),
    (b"BZh", "is compressed by bzip2; unpack it by bunzip2"),
    (b"PK\x03\x04", "is a ZIP archive, perhaps 3MF; unpack it, or export the mesh as STL"),
    (b"Kaydara FBX", "is an FBX file, which cannot be read; import it into Blender and export it as GLB"),
    (b"BLENDER", "is a Blender file; export the mesh as GLB"),
    (b"ISO-10303-21", "is a STEP file of a CAD program; export the part as STL, with FreeCAD for instance"),
    (b"version https://git-lfs", "is a pointer of Git LFS instead of the file itself; fetch it by 'git lfs pull'"),
    (b"<!DOCTYPE html", "is a web page, not a mesh; download the file itself"),
    (b"<html", "is a web page, not a mesh; download the file itself"),
)


def identify(content: bytes, suffix: str) -> str | None:
    """The format of a file with this content, as a key of :data:`READERS`; None if it is not known.

    Args:
        content: all bytes of the file.
        suffix: of its name, without the dot, in small letters. It decides where the content does not.

    Raises:
        UnreadableMeshError: the content is known, but is no mesh that can be read.
    """
    for start, message in FOREIGN:
        if content[:64].lstrip().lower().startswith(start.lower()):
            raise UnreadableMeshError(message)
    if content[:4] == b"glTF":
        return "glb"
    if re.match(rb"ply\s", content):
        return "ply"
    if suffix != "obj" and len(content) >= STL_HEADER:
        if len(content) == STL_HEADER + TRIANGLE.itemsize * announced(content) > STL_HEADER:
            return "stl"
        if content.lstrip()[:5].lower() == b"solid" and is_text(content):
            return "stl"
    text = decode(content[:SAMPLE])
    if OFF_HEADER.match(text.lstrip()):
        return "off"
    if text.lstrip().startswith("{") and '"asset"' in text:
        return "gltf"
    if suffix not in READERS or suffix in ("stl", "ply", "glb", "gltf"):
        if is_text(content):
            return "stl"
        if len(OBJ_LINE.findall(text)) > 3 and "\0" not in text:
            return "obj"
    return suffix if suffix in READERS else None


def known_suffixes() -> str:
    """The supported file name suffixes, for messages."""
    *others, last = READERS
    return ", ".join(f".{name}" for name in others) + f" or .{last}"
