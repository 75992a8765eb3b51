"""The meshes of a trajectory's solids, also of those that move."""

from __future__ import annotations

import numpy as np

from surfsup.exporting.mesh_frame import MeshFrame, joined, solid_mesh
from surfsup.io.trajectory import Trajectory
from surfsup.scene.pose import Pose, between
from surfsup.viewing.moving_mesh import MovingMesh
from surfsup.viewing.trajectory_page import trajectory_meshes


class SolidMeshes:
    """All solids of a trajectory as one mesh.

    Attributes:
        still: the solids that stand still, None without any.
        moving: the others, each in its own frame.
        move: whether there are any.

    Raises:
        InputError: a file of a solid is missing or unusable.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        still, self.moving = trajectory_meshes(trajectory)
        self._start_time, self._frame_time = trajectory.start_time, trajectory.frame_time
        self.still = None if still is None else solid_mesh(still)
        self.move = bool(self.moving)

    def _place(self, time: float) -> float:
        """A time in seconds as a number of frames."""
        return (time - self._start_time) / self._frame_time

    def pose_of(self, solid: MovingMesh, time: float) -> Pose:
        """The pose of a solid at a time in seconds."""
        return pose_at(solid.poses, self._place(time))

    def at(self, time: float) -> MeshFrame:
        """The solids at a time in seconds; their velocities are the mean ones of a frame of the trajectory."""
        place = self._place(time)
        parts = [] if self.still is None else [self.still]
        for solid in self.moving:
            own, last = solid_mesh(solid.mesh), len(solid.poses) - 1
            first, end = max(place - 0.5, 0.0), min(place + 0.5, float(last))
            before, now, after = (pose_at(solid.poses, at) for at in (first, place, end))
            velocities = np.zeros_like(own.vertices)
            if end > first:
                path = after.apply(own.vertices) - before.apply(own.vertices)
                velocities = (path / ((end - first) * self._frame_time)).astype(np.float32)
            vertices, normals = now.apply(own.vertices), own.normals @ now.matrix.T
            parts.append(
                MeshFrame(time, vertices.astype(np.float32), own.triangles, normals.astype(np.float32), velocities)
            )
        return joined(parts, time)


def pose_at(rows: np.ndarray, place: float) -> Pose:
    """The pose at a ``place`` in frames, between the poses (frames, 7) of the frames before and after."""
    place = min(max(place, 0.0), len(rows) - 1.0)
    first = min(int(place), max(0, len(rows) - 2))
    last = min(first + 1, len(rows) - 1)
    return between(Pose.from_array(rows[first]), Pose.from_array(rows[last]), place - first)
