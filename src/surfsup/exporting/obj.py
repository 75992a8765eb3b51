"""OBJ of Wavefront: triangles with normals as text. It has no place for velocities."""

from __future__ import annotations

import numpy as np

from surfsup.exporting.mesh_frame import MeshFrame


def mesh(frame: MeshFrame) -> bytes:
    """The vertices, their normals and the triangles of a mesh."""
    corners = np.repeat(frame.triangles + 1, 2, axis=1)  # the same number for a vertex and its normal
    lines = (
        f"# time {frame.time:.9g} s\n",
        ("v %.7g %.7g %.7g\n" * len(frame.vertices)) % tuple(frame.vertices.ravel().tolist()),
        ("vn %.4g %.4g %.4g\n" * len(frame.normals)) % tuple(frame.normals.ravel().tolist()),
        ("f %d//%d %d//%d %d//%d\n" * len(corners)) % tuple(corners.ravel().tolist()),
    )
    return "".join(lines).encode()
