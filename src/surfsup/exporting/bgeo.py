"""BGEO, version 5 ("classic"), the particle files of Houdini, partio, SPlisHSPlasH and splashsurf.

All numbers are big-endian. A header is followed by the attributes' names and types, the points, and an end mark; the
layout is that of partio's ``BGEO.cpp``.
"""

from __future__ import annotations

import struct

import numpy as np

from surfsup.exporting.frames import ParticleFrame

VERSION = 5
FLOAT, INTEGER, VECTOR = 0, 1, 5  # Houdini's types of attributes
END = b"\x00\xff"


def particles(frame: ParticleFrame) -> bytes:
    """Points ``P`` with ``v`` in m/s, ``id``, and ``pscale``, the radius in meters; of several liquids ``liquid``."""
    several = [] if frame.liquids is None else [("liquid", ">i4")]
    fields = [("P", ">f4", 4), ("v", ">f4", 3), ("id", ">i4"), ("pscale", ">f4"), *several]
    points = np.empty(len(frame.positions), fields)
    points["P"][:, :3], points["P"][:, 3] = frame.positions, 1.0  # homogeneous coordinates
    points["v"], points["id"], points["pscale"] = frame.velocities, frame.ids, frame.radius
    attributes = attribute("v", 3, VECTOR) + attribute("id", 1, INTEGER) + attribute("pscale", 1, FLOAT)
    if frame.liquids is not None:
        points["liquid"] = frame.liquids
        attributes += attribute("liquid", 1, INTEGER)
    return header(len(points), attributes=3 + len(several)) + attributes + points.tobytes() + END


def header(points: int, attributes: int) -> bytes:
    """The header of a file without primitives and groups."""
    primitives = point_groups = primitive_groups = vertex_attributes = primitive_attributes = detail_attributes = 0
    counts = (points, primitives, point_groups, primitive_groups, attributes)
    return b"BgeoV" + struct.pack(">9i", VERSION, *counts, vertex_attributes, primitive_attributes, detail_attributes)


def attribute(name: str, size: int, kind: int) -> bytes:
    """The definition of a point attribute, with zeros as its default values."""
    return struct.pack(f">H{len(name)}sHi{size}i", len(name), name.encode(), size, kind, *[0] * size)
