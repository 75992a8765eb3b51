"""How a solid follows the hand: at a limited speed, because water in the way of a jump is thrown aside."""

from __future__ import annotations

import numpy as np

from surfsup.scene import quaternion
from surfsup.scene.pose import Pose, between

SPEED = 0.8  # m/s, with particles of 15 mm; times the root of the scale with others
TURN = np.radians(150.0)  # per second


def towards(pose: Pose, target: Pose, seconds: float, scale: float = 1.0) -> Pose:
    """The pose after some seconds on the way to ``target``.

    Args:
        pose: the present one.
        target: the pose to reach.
        seconds: of the way.
        scale: of all speeds.
    """
    distance = float(np.linalg.norm(target.position - pose.position))
    turn = quaternion.logarithm(quaternion.product(quaternion.inverse(pose.rotation), target.rotation))
    needed = max(distance / (SPEED * scale), float(np.linalg.norm(turn)) / (TURN * scale))  # seconds
    return target if needed <= seconds else between(pose, target, seconds / needed)
