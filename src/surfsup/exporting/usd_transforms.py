"""The ways of solids that move as transforms with time samples."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from pxr import Gf, Tf, UsdGeom

from surfsup.exporting.up_axis import UpAxis, pose_with_up_axis
from surfsup.scene.pose import Pose


class TransformSamples:
    """Writes poses as ``xformOp:translate`` and ``xformOp:orient`` of meshes.

    Programs interpolate both between two samples, the rotation on the sphere, so their motion blur needs no velocities.

    Args:
        meshes: of the solids in their own frames, by name.
        up: upward axis of the file.
    """

    def __init__(self, meshes: Mapping[str, UsdGeom.Mesh], up: UpAxis) -> None:
        self._up = up
        precision = UsdGeom.XformOp.PrecisionDouble
        self._ops = {
            name: (mesh.AddTranslateOp(precision), mesh.AddOrientOp(precision)) for name, mesh in meshes.items()
        }
        self._last: dict[str, np.ndarray] = {}

    def add(self, name: str, pose: Pose, code: int) -> None:
        """Write the pose of a solid at a time code."""
        pose = pose_with_up_axis(pose, self._up)
        # q and -q are the same rotation; neighbors take the shorter way.
        rotation = pose.rotation if pose.rotation @ self._last.get(name, pose.rotation) >= 0 else -pose.rotation
        self._last[name] = rotation
        translate, orient = self._ops[name]
        translate.Set(Gf.Vec3d(*pose.position.tolist()), code)
        orient.Set(Gf.Quatd(*rotation.tolist()), code)


def prim_names(names: Iterable[str], taken: str) -> dict[str, str]:
    """Different names of prims for the names of solids, which may have any characters; none is ``taken``."""
    made: dict[str, str] = {}
    for name in names:
        valid = first = Tf.MakeValidIdentifier(name)
        number = 1
        while valid in (taken, *made.values()):
            number += 1
            valid = f"{first}_{number}"
        made[name] = valid
    return made
