"""OFF of Geomview: vertices, then polygons; also with normals, colors or texture coordinates, which are skipped."""

from __future__ import annotations

import re

import numpy as np

from surfsup.sdf.mesh.readers.polygons import triangulate
from surfsup.sdf.mesh.readers.raw_mesh import RawMesh, UnreadableMeshError
from surfsup.sdf.mesh.readers.text import decode, numbers

HEADER = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF\b[ \t]*(BINARY)?")


def read_off(content: bytes) -> RawMesh:
    """The polygons of an OFF file, as triangles.

    Raises:
        UnreadableMeshError: the file is binary, of more than three dimensions, damaged or cut off.
    """
    text = re.sub(r"#[^\n]*", "", decode(content)).lstrip()
    header = HEADER.match(text)
    if header:
        if header[4] or header[5]:
            raise UnreadableMeshError(f"is an OFF file of four or more dimensions ({header[0]}), which is no solid")
        if header[6]:
            raise UnreadableMeshError("is a binary OFF file (OFF BINARY), which cannot be read; export it as text")
        text = text[header.end() :]
    lines = [line.split() for line in text.split("\n")]
    lines = [words for words in lines if words]
    try:
        vertex_count, face_count = int(lines[0][0]), int(lines[0][1])
        sizes: list[int]
        if vertex_count < 0 or face_count < 0 or vertex_count + face_count > 2 * len(text):
            raise ValueError("its counts are out of range")
        rows, rest = lines[1 : 1 + vertex_count], lines[1 + vertex_count :]
        short = next((number for number, row in enumerate(rows) if len(row) < 3), None)
        if short is not None and len(lines) == 1 + vertex_count + face_count:
            raise ValueError(f"its vertex {short} has {len(rows[short])} coordinates")
        if len(lines[0]) > 3 or short is not None:
            rows, rest = regrouped(lines, vertex_count)
        vertices = numbers(word for row in rows for word in row[:3]).reshape(-1, 3)
        if len(vertices) != vertex_count:
            raise ValueError(f"it announces {vertex_count} vertices and has {len(vertices)}")
        sizes, corners = polygons(rest, face_count)
    except (ValueError, IndexError) as error:
        raise UnreadableMeshError(f"is damaged or not an OFF file ({error}); export it again") from None
    return RawMesh(vertices, triangulate(vertices, np.array(sizes, np.int64), np.array(corners, np.int64)))


def regrouped(lines: list[list[str]], vertex_count: int) -> tuple[list[list[str]], list[list[str]]]:
    """The rows of three vertex coordinates, and one row with all that follows, in a file without regular lines."""
    words = [word for row in lines for word in row][3:]
    split = 3 * vertex_count
    return [words[i : i + 3] for i in range(0, split, 3)], [words[split:]]


def polygons(rows: list[list[str]], count: int) -> tuple[list[int], list[int]]:
    """Size of each polygon, and the corners of all, one after the other.

    Every row has a size, that many indices, and perhaps a color. If some row is shorter, the words are taken one after
    the other, without colors.

    Raises:
        ValueError, IndexError: there are too few words or too many, or one is not an integer.
    """
    if any(len(row) <= int(row[0]) for row in rows[:count]) or len(rows) < count:
        words = [word for row in rows for word in row]
        rows, at = [], 0
        for _ in range(count):
            size = int(words[at])
            if size < 0:
                raise ValueError("a face has a negative number of corners")
            rows.append(words[at : at + size + 1])
            at += size + 1
        if at > len(words):
            raise ValueError("it ends within a face")
        if at < len(words):  # a word that is missing further up would shift all that follow
            raise ValueError(f"it has {len(words) - at} numbers more than its counts announce")
    sizes = [int(row[0]) for row in rows[:count]]
    return sizes, [int(word) for size, row in zip(sizes, rows, strict=False) for word in row[1 : size + 1]]
