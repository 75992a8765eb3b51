"""A smooth path through poses at given times."""

from __future__ import annotations

import itertools

import numpy as np

from surfsup.scene import pose, quaternion
from surfsup.scene.pose import Pose


class PoseCurve:
    """Poses over time: those given at their times, at rest before the first and after the last.

    A smooth path has continuous velocities, rests at both ends, and never overshoots a key: positions follow the
    monotone cubic splines of Fritsch and Carlson ("Monotone piecewise cubic interpolation", SIAM Journal on Numerical
    Analysis 17, 1980), rotations the quaternion curves of Kim, Kim and Shin ("A general construction scheme for unit
    quaternion curves with simple high order derivatives", SIGGRAPH 1995) with the same slopes. Between two keys a
    solid turns the shorter way.

    Args:
        times: (K,) seconds, increasing.
        poses: of the K keys.
        smooth: False for straight lines and constant speeds between the keys.
    """

    def __init__(self, times: np.ndarray, poses: list[Pose], smooth: bool = True) -> None:
        self.times, self.poses, self.smooth = np.asarray(times, np.float64), poses, smooth
        if len(poses) < 2 or not smooth:
            return
        steps = np.diff(self.times)[:, None]
        relative = [
            quaternion.product(quaternion.inverse(a.rotation), b.rotation) for a, b in itertools.pairwise(poses)
        ]
        self._slopes = monotone_slopes(np.diff([key.position for key in poses], axis=0) / steps, steps)
        self._rates = monotone_slopes(np.array([quaternion.logarithm(turn) for turn in relative]) / steps, steps)

    def pose(self, time: float) -> Pose:
        """The pose at ``time`` seconds."""
        number = int(np.searchsorted(self.times, time, side="right")) - 1
        if number < 0 or number >= len(self.poses) - 1:
            return self.poses[max(0, number)]
        start, end = self.poses[number], self.poses[number + 1]
        step = self.times[number + 1] - self.times[number]
        s = (time - self.times[number]) / step
        if not self.smooth:
            return pose.between(start, end, s)
        position = (
            (1 + 2 * s) * (1 - s) ** 2 * start.position
            + s * (1 - s) ** 2 * step * self._slopes[number]
            + s**2 * (3 - 2 * s) * end.position
            + s**2 * (s - 1) * step * self._slopes[number + 1]
        )
        first, last = self._rates[number] * step / 3, self._rates[number + 1] * step / 3
        middle = quaternion.logarithm(
            quaternion.product(
                quaternion.product(
                    quaternion.exponential(-first),
                    quaternion.product(quaternion.inverse(start.rotation), end.rotation),
                ),
                quaternion.exponential(-last),
            )
        )
        rotation = start.rotation
        for vector, weight in ((first, 1 - (1 - s) ** 3), (middle, s**2 * (3 - 2 * s)), (last, s**3)):
            rotation = quaternion.product(rotation, quaternion.exponential(weight * vector))
        return Pose(position, rotation / np.linalg.norm(rotation))


def monotone_slopes(rates: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Slopes (K, 3) at the keys for mean ``rates`` (K - 1, 3) over ``steps`` (K - 1, 1) seconds; zero at both ends.

    The weighted harmonic mean of the rates on both sides, and zero where their signs differ.
    """
    before, after = rates[:-1], rates[1:]
    first, second = 2 * steps[1:] + steps[:-1], steps[1:] + 2 * steps[:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (first + second) / (first / before + second / after)
    inner = np.where(before * after > 0, mean, 0.0)
    return np.concatenate([np.zeros((1, 3)), inner, np.zeros((1, 3))])
