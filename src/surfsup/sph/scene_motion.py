"""The motion of a scene's solids during a simulation, and what Python code changes of it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from copy import copy

from surfsup.errors import InputError
from surfsup.scene import PARTICLE_RADIUS, Scene
from surfsup.scene.motion import PoseFunction
from surfsup.scene.pose import Pose
from surfsup.scene.solids import build_solids
from surfsup.scene.units import Units
from surfsup.sph.moving import FrameMotion

JUMP = 20 * PARTICLE_RADIUS  # in a frame, in the units of the solver: 60 m/s


class PoseJumpWarning(UserWarning):
    """A solid moves so far in one frame that it throws water about; the message says which and when."""


class SceneMotion:
    """What moves in a scene: the motions of the scene, and those set since.

    Attributes:
        solids: of the scene, in its frames.

    Raises:
        InputError: a file of a surface or a motion is unusable.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._overrides: dict[str, PoseFunction] = {}
        self.solids = build_solids(scene)

    @property
    def driven(self) -> frozenset[str]:
        """The names of those whose motion was set; a rigid body among them moves freely no more."""
        return frozenset(self._overrides)

    def overridden(self, name: str, motion: PoseFunction) -> SceneMotion:
        """A copy with another motion of a surface or of the container; with the same solids if that moved before.

        Raises:
            InputError: there is none of that name.
        """
        changed = copy(self)
        if name not in self.solids.poses(0.0):
            changed.solids = build_solids(self._scene, [*self._overrides, name])
        changed._overrides = {**self._overrides, name: motion}
        return changed

    def next_poses(self, poses: Mapping[str, Pose], time: float) -> Mapping[str, Pose]:
        """The poses at ``time`` in seconds of all that moves.

        Raises:
            InputError: a function that was set returned no pose.
        """
        if not poses:
            return poses
        chosen = {name: motion(time) for name, motion in self._overrides.items()}
        if wrong := [name for name, pose in chosen.items() if not isinstance(pose, Pose)]:
            raise InputError(
                f"the motion of '{wrong[0]}' returned {type(chosen[wrong[0]]).__name__}, but must return a Pose"
            )
        return {**self.solids.poses(time), **chosen}


def warn_jumps(motion: FrameMotion, frame: int, units: Units) -> None:
    """Warn of solids that move very far in the step to ``frame``.

    Warns:
        PoseJumpWarning: naming the first of them.
    """
    if max(motion.displacements, default=0.0) <= JUMP:
        return
    path, body = max(zip(motion.displacements, motion.bodies, strict=True), key=lambda pair: pair[0])
    warnings.warn(
        f"surface '{body.solid.name}' moves {units.length * path:.2g} m in frame {frame}, at "
        f"{units.velocity * path / motion.seconds:.0f} m/s; "
        "water in its way is thrown aside, so let it move there over more frames",
        PoseJumpWarning,
        stacklevel=3,
    )
