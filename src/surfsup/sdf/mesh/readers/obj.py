"""Wavefront OBJ: vertices, and faces of any number of corners."""

from __future__ import annotations

import re

import numpy as np

from surfsup.sdf.mesh.readers.polygons import triangulate
from surfsup.sdf.mesh.readers.raw_mesh import RawMesh, UnreadableMeshError
from surfsup.sdf.mesh.readers.text import decode, numbers

FREE_FORM = {"surf", "curv", "curv2", "cstype", "bzp", "bsp", "cdc"}


def read_obj(content: bytes) -> RawMesh:
    """The faces of an OBJ file.

    Materials, normals, colors, groups, lines and points are skipped. Indices may be relative (negative); keywords may
    be capitals; lines may be indented, continued by a backslash, or end in a comment.

    Raises:
        UnreadableMeshError: a line is not what its keyword says, or an index refers to no vertex.
    """
    text = decode(content).replace("\\\n", " ")
    if "#" in text:
        text = re.sub(r"#[^\n]*", "", text)
    points: list[str] = []
    sizes, corners, weighted, other = [], [], False, set()
    for line in text.split("\n"):
        words = line.split()
        if not words:
            continue
        keyword = words[0]
        if keyword in ("v", "V"):
            if len(words) < 4:
                raise UnreadableMeshError(f"has a vertex that is not three numbers ('{shown(line)}'); export it again")
            points += words[1:4]
            weighted |= len(words) == 5 and words[4] not in ("1", "1.0")
        elif keyword in ("f", "F"):
            try:
                indices = [int(word.split("/", 1)[0]) for word in words[1:]]
            except ValueError:
                raise UnreadableMeshError(f"has a face that is not a list of indices ('{shown(line)}')") from None
            if 0 in indices:
                raise UnreadableMeshError("has a face with the index 0, but OBJ counts from 1; export it again")
            so_far = len(points) // 3
            sizes.append(len(indices))
            corners += [index - 1 if index > 0 else so_far + index for index in indices]
            if min(corners[-len(indices) :], default=0) < 0:
                raise UnreadableMeshError("has a face with a relative index before the first vertex; export it again")
        elif keyword.lower() in FREE_FORM:
            other.add(keyword.lower())
    try:
        vertices = numbers(points).reshape(-1, 3)
    except ValueError as error:
        raise UnreadableMeshError(f"has a vertex that is not three numbers ({error}); export it again") from None
    remarks = []
    if other:
        what = f"free-form curves or surfaces ({', '.join(sorted(other))})"
        if not sizes:
            raise UnreadableMeshError(f"describes its shape by {what}, which cannot be read; export it as polygons")
        remarks.append(f"has {what}, which were left out")
    if weighted:
        remarks.append("has vertices with a weight, which was ignored: it concerns free-form surfaces alone")
    check_indices(corners, len(vertices))
    return RawMesh(vertices, triangulate(vertices, np.array(sizes), np.array(corners)), remarks)


def check_indices(corners: list[int], count: int) -> None:
    """Refuse an index beyond the last of ``count`` vertices.

    Raises:
        UnreadableMeshError: there is one.
    """
    if corners and max(corners) >= count:
        raise UnreadableMeshError(
            f"is damaged: a face refers to vertex {max(corners) + 1}, but there are {count}; export it again"
        )


def shown(line: str) -> str:
    """The start of a line, for a message."""
    return "".join(letter if letter.isprintable() else "?" for letter in " ".join(line.split()))[:40]
