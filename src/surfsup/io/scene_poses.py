"""The poses of everything that moves in a trajectory, also where its file has none."""

from __future__ import annotations

import numpy as np

from surfsup.io.trajectory import Trajectory
from surfsup.scene.solids import CONTAINER, build_solids


def scene_poses(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Poses (frames, 7) by name of all that moves: those in the file, or else as the scene describes them.

    Raises:
        InputError: a pose is not in the file, and a file of the scene is missing or unusable.
    """
    scene = trajectory.scene
    entries = {**scene.surfaces, CONTAINER: scene.container}
    if all(name in trajectory.poses for name, entry in entries.items() if getattr(entry, "motion", None) is not None):
        return trajectory.poses
    solids = build_solids(scene)
    frames = [solids.poses(trajectory.start_time + k * trajectory.frame_time) for k in range(len(trajectory))]
    described = {name: np.array([poses[name].array for poses in frames]) for name in solids.poses(0.0)}
    return {**described, **trajectory.poses}
