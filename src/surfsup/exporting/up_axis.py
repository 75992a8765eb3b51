"""The upward axis of exported files: z as in surfsup, or y by a rotation of the data."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, TypeVar

import numpy as np

from surfsup.exporting.frames import ParticleFrame
from surfsup.exporting.mesh_frame import MeshFrame
from surfsup.scene.pose import Pose

UpAxis = Literal["y", "z"]
VECTORS = ("positions", "velocities", "vertices", "normals")  # fields of frames that turn with the axes
AnyFrame = TypeVar("AnyFrame", ParticleFrame, MeshFrame)


def with_up_axis(frame: AnyFrame, up: UpAxis) -> AnyFrame:
    """The frame with ``up`` as its upward axis; y by a rotation of -90 degrees about x: (x, y, z) to (x, z, -y)."""
    if up == "z":
        return frame
    vectors: dict[str, Any] = {name: turned(values) for name, values in vars(frame).items() if name in VECTORS}
    return replace(frame, **vectors)


def pose_with_up_axis(pose: Pose, up: UpAxis) -> Pose:
    """The pose with ``up`` as its upward axis, of a solid whose own frame has it too."""
    if up == "z":
        return pose
    position, axis = turned(np.stack([pose.position, pose.rotation[1:]]))
    return Pose(position, np.array([pose.rotation[0], *axis]))


def turned(vectors: np.ndarray) -> np.ndarray:
    """Vectors (N, 3) with upward axis y instead of z."""
    x, y, z = vectors.T
    return np.stack([x, z, -y], axis=1)
