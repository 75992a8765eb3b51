"""Rotations as unit quaternions (w, x, y, z), arrays of four float64."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def normalized(values: Sequence[float] | np.ndarray) -> np.ndarray:
    """The unit quaternion (4,) along ``values`` (4,).

    Raises:
        ValueError: it is zero, or not four finite numbers.
    """
    quaternion = np.asarray(values, np.float64)
    if quaternion.shape != (4,) or not np.isfinite(quaternion).all():
        raise ValueError(f"a rotation is a quaternion of four finite numbers w, x, y, z (found {list(values)})")
    length = float(np.linalg.norm(quaternion))
    if length < 1e-9:
        raise ValueError("a rotation cannot be the quaternion zero; no rotation is 1, 0, 0, 0")
    return quaternion / length


def about_axis(axis: Sequence[float] | np.ndarray, radians: float) -> np.ndarray:
    """The right-handed rotation (4,) by an angle about ``axis`` (3,), which is not zero."""
    direction = np.asarray(axis, np.float64)
    return np.array([math.cos(radians / 2), *(math.sin(radians / 2) / np.linalg.norm(direction) * direction)])


def product(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The rotation (4,) by ``other``, then by ``one``."""
    w, x, y, z = one
    a, b, c, d = other
    return np.array(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ]
    )


def inverse(quaternion: np.ndarray) -> np.ndarray:
    """The opposite rotation (4,)."""
    return quaternion * (1, -1, -1, -1)


def exponential(vector: np.ndarray) -> np.ndarray:
    """The rotation (4,) by the length of ``vector`` (3,) in rad about its direction."""
    angle = math.sqrt(vector @ vector)
    half = np.sinc(angle / (2 * math.pi)) / 2  # sin(angle / 2) / angle
    return np.array([math.cos(angle / 2), *(half * vector)])


def logarithm(quaternion: np.ndarray) -> np.ndarray:
    """The vector (3,) of :func:`exponential`, at most half a turn long."""
    if quaternion[0] < 0:
        quaternion = -quaternion
    sine = math.sqrt(quaternion[1:] @ quaternion[1:])
    return quaternion[1:] * (2 * math.atan2(sine, quaternion[0]) / sine if sine > 1e-12 else 2.0)


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """The rotation matrix (3, 3) of a unit quaternion (4,)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
