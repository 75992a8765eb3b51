"""Particles of a BGEO file, version 5 ("classic"), as Houdini, partio, SPlisHSPlasH and splashsurf write them.

The layout is that of partio's ``BGEO.cpp``; all numbers are big-endian, and the file may be compressed by gzip.
"""

from __future__ import annotations

import gzip
import io
import struct
from pathlib import Path

import numpy as np

MAGIC, VERSION = b"BgeoV", 5
GZIP = b"\x1f\x8b"
INDEXED_STRING = 4
KINDS = {0: ">f4", 1: ">i4", INDEXED_STRING: ">i4", 5: ">f4"}  # float, integer, string, vector
VELOCITY_NAMES = ("v", "velocity")
MAX_BYTES = 1 << 32  # of a decompressed file


def read_bgeo(path: Path) -> np.ndarray:
    """Positions (N, 3), or with velocities (N, 6).

    Raises:
        ValueError: it is another file, of a newer version, or cut off.
    """
    data = path.read_bytes()
    if data.startswith(GZIP):
        with gzip.open(path) as packed:
            data = packed.read(MAX_BYTES)
    stream = io.BytesIO(data)
    if stream.read(len(MAGIC)) != MAGIC:
        raise ValueError("it is no BGEO file of version 5; newer ones begin otherwise, and Houdini's gconvert converts")
    version, count, _, _, _, attributes, *_ = numbers(stream, ">9i")
    if version != VERSION:
        raise ValueError(f"it has version {version}, but version {VERSION} is read")
    fields: list[tuple[str, str, int]] = [("P", ">f4", 4)]  # homogeneous coordinates
    velocity = None
    for number in range(attributes):
        name, size, kind = attribute(stream)
        fields.append((f"{number}", KINDS[kind], size))
        if name in VELOCITY_NAMES and size == 3:
            velocity = f"{number}"
    row = np.dtype(fields)
    table = stream.read(count * row.itemsize)
    if count < 0 or len(table) < count * row.itemsize:
        raise ValueError("it was cut off")
    points = np.frombuffer(table, row)
    positions = points["P"][:, :3]
    return positions if velocity is None else np.concatenate([positions, points[velocity]], axis=1)


def attribute(stream: io.BytesIO) -> tuple[str, int, int]:
    """Name, number of values and kind of the next point attribute; its default values are skipped."""
    (length,) = numbers(stream, ">H")
    name = stream.read(length).decode("latin-1")
    size, kind = numbers(stream, ">Hi")
    if kind not in KINDS:
        raise ValueError(f"its attribute '{name}' has the unknown type {kind}")
    if kind == INDEXED_STRING:
        (strings,) = numbers(stream, ">i")
        for _ in range(strings):
            (length,) = numbers(stream, ">H")
            stream.seek(length, io.SEEK_CUR)
        return name, size, kind
    stream.seek(4 * size, io.SEEK_CUR)
    return name, size, kind


def numbers(stream: io.BytesIO, form: str) -> tuple[int, ...]:
    """The next numbers of the file."""
    size = struct.calcsize(form)
    if len(data := stream.read(size)) < size:
        raise ValueError("it was cut off")
    return struct.unpack(form, data)
