"""The surfaces that carry taps and drains."""

from __future__ import annotations

from typing import TYPE_CHECKING

from surfsup.scene.pose import Pose
from surfsup.scene.solids import CONTAINER, Solids, as_named_shape

if TYPE_CHECKING:
    from surfsup.scene.scene import Scene


def carrier_poses(scene: Scene, solids: Solids, time: float) -> dict[str, Pose]:
    """The pose by name of every surface and of the container at a time in seconds, also of those that stand still."""
    poses = {CONTAINER: Pose.of()}
    for name, entry in scene.surfaces.items():
        shape = as_named_shape(entry)
        poses[name] = Pose.of() if shape is None else shape.rest
    return {**poses, **solids.poses(time)}
