"""Poses of solids: where a solid's frame is in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surfsup.errors import InputError
from surfsup.scene import quaternion
from surfsup.scene.strict_model import MAX_COORDINATE

Vector = Sequence[float] | np.ndarray
NO_ROTATION = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Pose:
    """A solid's frame in the world: points of the solid are rotated, then moved by ``position``.

    Attributes:
        position: (3,) float64, meters, of the origin of the solid's frame.
        rotation: (4,) float64, unit quaternion w, x, y, z.

    Examples:
        >>> import surfsup as sf
        >>> sf.Pose.of((0, 0, 1), (2, 0, 0, 0)).rotation.tolist()  # any length but zero
        [1.0, 0.0, 0.0, 0.0]
    """

    position: np.ndarray
    rotation: np.ndarray

    @classmethod
    def of(cls, position: Vector = (0.0, 0.0, 0.0), rotation: Vector = NO_ROTATION) -> Pose:
        """The pose at ``position`` (3,) with ``rotation`` (4,), a quaternion w, x, y, z of any length but zero.

        Raises:
            InputError: a value is not finite or too large, has another length, or the quaternion is zero.
        """
        place = numbers(position)
        if place.shape != (3,) or not (np.abs(place) <= MAX_COORDINATE).all():
            raise InputError(
                f"a pose: position is three numbers of meters, at most {MAX_COORDINATE:g} (found {position})"
            )
        try:
            return cls(place, quaternion.normalized(rotation))
        except (ValueError, TypeError, OverflowError) as error:
            raise InputError(f"a pose: {error}") from None

    @property
    def matrix(self) -> np.ndarray:
        """The rotation matrix (3, 3)."""
        return quaternion.matrix(self.rotation)

    @property
    def array(self) -> np.ndarray:
        """Position and rotation in one array (7,)."""
        return np.concatenate([self.position, self.rotation])

    @classmethod
    def from_array(cls, values: np.ndarray) -> Pose:
        """The pose of :attr:`array`."""
        return cls(np.array(values[:3], np.float64), np.array(values[3:], np.float64))

    def apply(self, points: np.ndarray) -> np.ndarray:
        """World coordinates of ``points`` (N, 3) in the solid's frame."""
        return points @ self.matrix.T + self.position

    def to_own(self, points: np.ndarray) -> np.ndarray:
        """World ``points`` (N, 3) in the solid's frame."""
        return (points - self.position) @ self.matrix


def numbers(values: object) -> np.ndarray:
    """``values`` as float64, or an empty array if they are no numbers."""
    try:
        return np.array(values, np.float64)
    except (TypeError, ValueError, OverflowError):
        return np.empty(0)


def between(one: Pose, other: Pose, part: float) -> Pose:
    """The pose at a ``part`` of the way: straight at constant speed, and turned at constant rate the shorter way."""
    turn = quaternion.logarithm(quaternion.product(quaternion.inverse(one.rotation), other.rotation))
    return Pose(
        (1 - part) * one.position + part * other.position,
        quaternion.product(one.rotation, quaternion.exponential(part * turn)),
    )
