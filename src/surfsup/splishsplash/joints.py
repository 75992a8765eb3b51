"""Joints of a scene file of SPlisHSPlasH: hinges become axles, and motors become motions.

A motor with a target velocity holds ω₂ − ω₁ along its axis at the target, whatever the water does (C. Deul,
P. Charrier, J. Bender, "Position-Based Rigid-Body Dynamics", Computer Animation and Virtual Worlds 27, 2016). So a body
that it turns has a given motion. A sequence of targets is joined by straight lines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from surfsup.scene import quaternion
from surfsup.scene.motion import COLUMNS
from surfsup.scene.pose import Pose

Json = Mapping[str, Any]
HINGE, MOTOR = "HingeJoints", "TargetVelocityMotorHingeJoints"
OTHERS = (
    "BallJoints", "BallOnLineJoints", "UniversalJoints", "SliderJoints", "RigidBodyParticleBallJoints",
    "RigidBodySprings", "DistanceJoints", "DamperJoints", "TargetAngleMotorHingeJoints",
    "TargetPositionMotorSliderJoints", "TargetVelocityMotorSliderJoints",
)  # fmt: skip
STEP = 0.02  # seconds between two poses of a motor whose target changes


@dataclass(frozen=True)
class Hinge:
    """A body that turns about an axis that stands still, in the coordinates of the file.

    Attributes:
        point: (3,) on the axis, meters.
        axis: (3,).
        rates: (K, 2) times in seconds and rates of the turn in rad/s; None where the body turns freely.
        repeats: whether the rates begin anew after the last one.
    """

    point: np.ndarray
    axis: np.ndarray
    rates: np.ndarray | None = None
    repeats: bool = False

    def angles(self, times: np.ndarray) -> np.ndarray:
        """The angles (N,) in radians at ascending ``times`` (N,), the first of them 0."""
        assert self.rates is not None
        nodes, rates = self.rates.T
        within = times % nodes[-1] if self.repeats and nodes[-1] > 0 else times
        now = np.interp(within, nodes, rates)
        return np.concatenate([[0.0], np.cumsum(np.diff(times) * (now[1:] + now[:-1]) / 2)])


def hinges_of(content: Json) -> tuple[dict[Any, Hinge | None], list[str]]:
    """The hinge of each body on a joint by its id, None for one that we do not have, and phrases about those.

    Raises:
        ValueError: a value is unusable.
    """
    moving = {body.get("id") for body in content.get("RigidBodies", []) if body.get("isDynamic")}
    hinges: dict[Any, Hinge | None] = {}
    missing = []
    for kind in OTHERS:
        if joints := content.get(kind, []):
            missing.append(f"{len(joints)} {kind}")
        hinges |= {joint[key]: None for joint in joints for key in ("bodyID1", "bodyID2") if key in joint}
    for joint, is_motor in [*((each, False) for each in content.get(HINGE, [])),
                            *((each, True) for each in content.get(MOTOR, []))]:  # fmt: skip
        ends = [joint["bodyID1"], joint["bodyID2"]]
        free = [end for end in ends if end in moving]
        if len(free) != 1 or free[0] in hinges:
            missing.append("a hinge between bodies that both move" if len(free) > 1 else "a body on several joints")
            hinges |= dict.fromkeys(free)
            continue
        point, axis = (np.asarray(joint[key], float) for key in ("position", "axis"))
        if point.shape != (3,) or axis.shape != (3,) or not np.isfinite([point, axis]).all() or not axis.any():
            raise ValueError("a joint needs a position and an axis of three numbers")
        rates = rates_of(joint, -1.0 if free[0] == ends[0] else 1.0) if is_motor else None
        hinges[free[0]] = Hinge(point, axis, rates, bool(joint.get("repeatSequence")))
    return hinges, missing


def rates_of(joint: Json, sign: float) -> np.ndarray:
    """Times and rates (K, 2) of a motor, whose target is ``sign`` times the rate of the body that moves.

    Raises:
        ValueError: the sequence is not one of times and targets.
    """
    sequence = np.asarray(joint.get("targetSequence") or [0.0, float(joint.get("target", 0.0))], float)
    if sequence.ndim != 1 or len(sequence) % 2 or not np.isfinite(sequence).all():
        raise ValueError("targetSequence of a joint must be pairs of a time and a target")
    rates = sequence.reshape(-1, 2) * [1.0, sign]
    if not (np.diff(rates[:, 0]) > 0).all():
        raise ValueError("the times of a targetSequence must increase")
    return rates


def pose_table(hinge: Hinge, rest: Pose, point: np.ndarray, axis: Sequence[float], seconds: float) -> bytes:
    """A CSV file of the poses of a body that a motor turns.

    Args:
        hinge: of the body.
        rest: its pose at first, in our scene.
        point: (3,) on the axis, in our scene.
        axis: (3,), in our scene.
        seconds: to be covered; the body then stands still.
    """
    times = np.linspace(0, seconds, max(2, round(seconds / STEP) + 1))
    lines = [",".join(COLUMNS)]
    for time, angle in zip(times, hinge.angles(times), strict=True):
        turn = quaternion.about_axis(axis, angle)
        place = point + quaternion.matrix(turn) @ (rest.position - point)
        row = (time, *place, *quaternion.product(turn, rest.rotation))
        lines.append(",".join(f"{value:.9g}" for value in row))
    return ("\n".join(lines) + "\n").encode()
