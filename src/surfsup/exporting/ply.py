"""PLY, binary and little-endian, after G. Turk, "The PLY polygon file format", 1994."""

from __future__ import annotations

import numpy as np

from surfsup.exporting.frames import ParticleFrame
from surfsup.exporting.mesh_frame import MeshFrame

TYPES = {"<f4": "float", "<i4": "int"}


def particles(frame: ParticleFrame) -> bytes:
    """Positions x, y, z, velocities vx, vy, vz, id and radius of the particles; liquid where there are several."""
    radius = np.full(len(frame.positions), frame.radius)
    columns = {"x y z": frame.positions, "vx vy vz": frame.velocities, "id": frame.ids, "radius": radius}
    vertex = table(columns if frame.liquids is None else {**columns, "liquid": frame.liquids})
    return header(frame.time, vertex) + vertex.tobytes()


def mesh(frame: MeshFrame) -> bytes:
    """Vertices x, y, z with normals nx, ny, nz and velocities vx, vy, vz; triangles."""
    vertex = table({"x y z": frame.vertices, "nx ny nz": frame.normals, "vx vy vz": frame.velocities})
    face = np.empty(len(frame.triangles), [("count", "u1"), ("vertex", "<i4", 3)])
    face["count"], face["vertex"] = 3, frame.triangles
    lines = f"element face {len(face)}\nproperty list uchar int vertex_indices\n"
    return header(frame.time, vertex, lines) + vertex.tobytes() + face.tobytes()


def table(columns: dict[str, np.ndarray]) -> np.ndarray:
    """A structured array from arrays (N,) or (N, K), whose keys are the K names of the fields."""
    names = [
        (name, "<i4" if values.dtype.kind == "i" else "<f4") for key, values in columns.items() for name in key.split()
    ]
    rows = np.empty(len(next(iter(columns.values()))), names)
    for key, values in columns.items():
        for name, column in zip(key.split(), np.atleast_2d(values.T), strict=True):
            rows[name] = column
    return rows


def header(time: float, vertex: np.ndarray, more: str = "") -> bytes:
    """The header of a file with the fields of ``vertex``, its comment the time in seconds."""
    kinds = [(name, TYPES[vertex.dtype[name].str]) for name in vertex.dtype.names or ()]
    properties = "".join(f"property {kind} {name}\n" for name, kind in kinds)
    start = f"ply\nformat binary_little_endian 1.0\ncomment time {time:.9g} s\nelement vertex {len(vertex)}\n"
    return f"{start}{properties}{more}end_header\n".encode()
