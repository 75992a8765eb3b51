"""STL: loose triangles, binary or text."""

from __future__ import annotations

import re

import numpy as np

from surfsup.sdf.mesh.readers.raw_mesh import RawMesh, UnreadableMeshError
from surfsup.sdf.mesh.readers.text import decode, numbers

HEADER = 84  # bytes before the first triangle
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
VERTEX_LINE = re.compile(r"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)[ \t]*$", re.IGNORECASE | re.MULTILINE)
FACET_LINE = re.compile(r"^[ \t]*facet\b", re.IGNORECASE | re.MULTILINE)


def read_stl(content: bytes) -> RawMesh:
    """The triangles of an STL file, of all its solids. Normals are ignored: the order of the corners counts.

    Raises:
        UnreadableMeshError: the file is cut off or contains no triangles.
    """
    if is_text(content):
        return read_text(decode(content))
    return read_binary(content)


def is_text(content: bytes) -> bool:
    """Whether an STL file is text. The header of a binary one may begin with "solid", too; then its size decides."""
    if len(content) >= HEADER and len(content) == HEADER + TRIANGLE.itemsize * announced(content):
        return False
    return VERTEX_LINE.search(decode(content[:4096])) is not None


def announced(content: bytes) -> int:
    """The number of triangles in the header of a binary file."""
    return int.from_bytes(content[HEADER - 4 : HEADER], "little")


def read_text(text: str) -> RawMesh:
    """The triangles of a text file.

    Raises:
        UnreadableMeshError: a facet is not three vertices, or a coordinate is not a number.
    """
    rows, facets = VERTEX_LINE.findall(text), len(FACET_LINE.findall(text))
    if len(rows) != 3 * facets:
        raise UnreadableMeshError(
            f"is damaged or cut off: its {facets} facets have {len(rows)} vertices instead of {3 * facets}; "
            "export it again"
        )
    try:
        vertices = numbers(word for row in rows for word in row).reshape(-1, 3)
    except ValueError as error:
        raise UnreadableMeshError(f"is damaged: a vertex is not three numbers ({error}); export it again") from None
    return RawMesh(vertices, np.arange(len(vertices)).reshape(-1, 3))


def read_binary(content: bytes) -> RawMesh:
    """The triangles of a binary file; where its size contradicts the header, the size counts if it can.

    Raises:
        UnreadableMeshError: the file ends within a triangle, or before the first.
    """
    size, count = len(content) - HEADER, announced(content) if len(content) >= HEADER else 0
    if size < TRIANGLE.itemsize:
        raise UnreadableMeshError("contains no triangles that can be read; is it a complete STL mesh?")
    whole, rest = divmod(size, TRIANGLE.itemsize)
    remarks = []
    if rest and count > whole:
        raise UnreadableMeshError(
            f"is cut off, or no STL file: it announces {count:,} triangles and has room for {whole:,}, "
            "so no triangles were read; export it again"
        )
    if rest and count == 0:
        raise UnreadableMeshError("contains no triangles that can be read; is it a complete STL mesh?")
    if rest:
        whole = count
        remarks.append(f"has {size - count * TRIANGLE.itemsize} bytes after its last triangle, which were ignored")
    elif whole != count:
        remarks.append(f"announces {count:,} triangles and contains {whole:,}; all of these were read")
    triangles = np.frombuffer(content, TRIANGLE, whole, HEADER)
    vertices = triangles["corners"].reshape(-1, 3).astype(np.float64)
    return RawMesh(vertices, np.arange(len(vertices)).reshape(-1, 3), remarks)
