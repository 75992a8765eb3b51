"""The motion of solids in SPlisHSPlasH: a pose and a velocity for each of its time steps.

A solid with ``isAnimated`` gets its pose from outside, in a call after each step. Its point velocity enters the
divergence and density solve of the next step. Before the first call no solid can be reached, so that in the very first
step of 1 ms a moving solid has no velocity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from surfsup.scene import FRAME_TIME, quaternion
from surfsup.scene.pose import Pose, between
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS

MOTION_FILE = "motions.npy"


@dataclass(frozen=True)
class SolidMotion:
    """The poses of a solid at all frames; in between it moves straight and turns at constant rate.

    Attributes:
        frames: the pose at each frame.
    """

    frames: list[Pose]

    @classmethod
    def of(cls, pose: Callable[[float], Pose], frames: int) -> SolidMotion:
        """The motion over a number of frames of a pose that is a function of time."""
        return cls([pose(number * FRAME_TIME) for number in range(frames)])

    @property
    def start(self) -> dict[str, object]:
        """The keys of the first pose in the solver's scene file."""
        turn = quaternion.logarithm(self.frames[0].rotation)
        angle = float(np.linalg.norm(turn))
        return {
            "isAnimated": True,
            "translation": self.frames[0].position.tolist(),
            "rotationAxis": (turn / angle).tolist() if angle > 0 else [1.0, 0.0, 0.0],
            "rotationAngle": angle,
        }

    def steps(self) -> np.ndarray:
        """Pose and velocity (steps + 1, 13) at the start of each time step of the solver.

        Columns: position, rotation as a quaternion x, y, z, w, velocity in m/s, angular velocity in rad/s.
        """
        rows = []
        for one, other in zip(self.frames, self.frames[1:], strict=False):
            poses = [between(one, other, k / SUBSTEPS) for k in range(SUBSTEPS + 1)]
            turn = quaternion.product(poses[1].rotation, quaternion.inverse(poses[0].rotation))
            velocity = (poses[1].position - poses[0].position) / SUBSTEP_TIME
            spin = quaternion.logarithm(turn) / SUBSTEP_TIME
            for pose in poses[:-1]:
                rows.append([*pose.position, *np.roll(pose.rotation, -1), *velocity, *spin])
        last = self.frames[-1]
        rows.append([*last.position, *np.roll(last.rotation, -1), *[0.0] * 6])
        return np.array(rows)


def write_motions(path: Path, motions: Mapping[int, SolidMotion]) -> None:
    """Write the motions by number of boundary: a table (boundaries, steps + 1, 14), the number in the last column."""
    tables = [np.insert(motion.steps(), 13, number, axis=1) for number, motion in motions.items()]
    np.save(path, np.stack(tables))
