"""Frames between two frames, on cubic Hermite splines through positions and velocities."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TypeVar

import numpy as np
from torch import Tensor

from surfsup.scene import FRAME_TIME

ROUNDING = 1e-6  # of a frame, by which times may differ
Values = TypeVar("Values", Tensor, np.ndarray)
Frame = tuple[np.ndarray, np.ndarray]


def hermite(
    old: tuple[Values, Values], new: tuple[Values, Values], part: float, frame_time: float = FRAME_TIME
) -> tuple[Values, Values]:
    """Positions and velocities (N, 3) at a ``part`` of the way between two frames.

    Args:
        old, new: positions (N, 3) and velocities (N, 3) of two consecutive frames.
        part: from 0 to 1.
        frame_time: between the two, seconds.
    """
    s, h = part, frame_time
    positions = (
        (1 + 2 * s) * (1 - s) ** 2 * old[0]
        + s * (1 - s) ** 2 * h * old[1]
        + s**2 * (3 - 2 * s) * new[0]
        + s**2 * (s - 1) * h * new[1]
    )
    velocities = 6 * s * (1 - s) / h * (new[0] - old[0]) + (1 - s) * (1 - 3 * s) * old[1] + s * (3 * s - 2) * new[1]
    return positions, velocities


def frames_needed(frames: int, interval: float) -> int:
    """Number of a simulator's frames that ``frames`` frames every ``interval`` of them lie within."""
    return 1 + math.ceil((frames - 1) * interval - ROUNDING)


def resample(frames: Iterable[Frame], interval: float) -> Iterator[Frame]:
    """The frames of a simulator at another rate.

    Args:
        frames: positions (N, 3) and velocities (N, 3) of consecutive frames.
        interval: frames of the simulator in one frame of the result.
    """
    before: Frame | None = None
    yielded = 0
    for number, frame in enumerate(frames):
        while (target := yielded * interval) <= number + ROUNDING:
            part = target - (number - 1)
            yield frame if before is None or part > 1 - ROUNDING else hermite(before, frame, part)
            yielded += 1
        before = frame
