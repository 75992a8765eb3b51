"""Meshes of solids that move, with their poses over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import trimesh

from surfsup.scene.pose import Pose


@dataclass(frozen=True)
class MovingMesh:
    """A solid in its own frame, and where it is.

    Attributes:
        mesh: triangles in meters.
        poses: (frames, 7), position and quaternion w, x, y, z.
        name: of the solid.
    """

    mesh: trimesh.Trimesh
    poses: np.ndarray
    name: str = "solid"

    def at(self, frame: int) -> trimesh.Trimesh:
        """The triangles in the world at a frame."""
        pose = Pose.from_array(self.poses[frame])
        return trimesh.Trimesh(pose.apply(np.asarray(self.mesh.vertices)), self.mesh.faces, process=False)

    def bounds(self) -> np.ndarray:
        """Corners (2, 3) of a box around the solid over all frames, from the corners of the box around it."""
        corners = trimesh.bounds.corners(self.mesh.bounds)
        places = np.concatenate([Pose.from_array(row).apply(corners) for row in self.poses])
        return np.stack([places.min(axis=0), places.max(axis=0)])

    def scaled(self, factor: float) -> MovingMesh:
        """The same with all lengths times ``factor``."""
        return MovingMesh(self.mesh.copy().apply_scale(factor), scaled_poses(self.poses, factor), self.name)


def scaled_poses(poses: np.ndarray, factor: float) -> np.ndarray:
    """Poses (frames, 7) whose positions are times ``factor``; rotations stay."""
    return np.concatenate([factor * poses[:, :3], poses[:, 3:]], axis=1)


def at_frame(still: trimesh.Trimesh | None, moving: Sequence[MovingMesh], frame: int) -> trimesh.Trimesh | None:
    """All solids at a frame as one mesh; None without any."""
    meshes = [*([] if still is None else [still]), *(solid.at(frame) for solid in moving)]
    if len(meshes) < 2:
        return meshes[0] if meshes else None
    return cast(trimesh.Trimesh, trimesh.util.concatenate(meshes))


def bounds_of(still: trimesh.Trimesh | None, moving: Sequence[MovingMesh]) -> np.ndarray | None:
    """Corners (2, 3) of a box around all solids over all frames; None without any."""
    boxes = [solid.bounds() for solid in moving]
    if still is not None and len(still.faces):
        boxes.append(np.asarray(still.bounds))
    return np.stack([np.min(boxes, axis=0)[0], np.max(boxes, axis=0)[1]]) if boxes else None


def container_corners(size: tuple[float, float, float], poses: Mapping[str, np.ndarray], frame: int) -> np.ndarray:
    """The corners (8, 3) of the container at a frame: four of its floor, then four above them."""
    x, y, z = size
    corners = np.array(
        [[sx * x / 2, sy * y / 2, h] for h in (0.0, z) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    return Pose.from_array(poses["container"][frame]).apply(corners) if "container" in poses else corners
