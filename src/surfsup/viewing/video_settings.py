"""What a video shows: its pictures per second, their size, and where the camera is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surfsup.errors import InputError
from surfsup.viewing.camera import DEFAULT_DIRECTION, ViewDirection
from surfsup.viewing.video import FRAMES_PER_SECOND, choose_frames

MIN_SIDE, MAX_SIDE = 64, 4096  # pixels
MAX_RATE = 120.0
_ROUNDING = 1e-6  # frames


@dataclass(frozen=True)
class VideoSettings:
    """The settings of a video.

    Attributes:
        size: (width, height) in pixels.
        fps: pictures per second, in real time; by default 25, and faster than real time if there were more than 120.
        every: show every n-th frame instead, however long that takes.
        direction: from where the camera looks.
        turntable: whether the camera goes around the scene once.

    Raises:
        InputError: a value is out of range.
    """

    size: tuple[int, int] = (960, 720)
    fps: float | None = None
    every: int | None = None
    direction: ViewDirection = DEFAULT_DIRECTION
    turntable: bool = False

    def __post_init__(self) -> None:
        if not all(MIN_SIDE <= side <= MAX_SIDE for side in self.size):
            raise InputError(f"size: {self.size[0]}x{self.size[1]} is not between {MIN_SIDE} and {MAX_SIDE} pixels")
        if self.fps is not None and not 1 <= self.fps <= MAX_RATE:
            raise InputError(f"fps: {self.fps:g} is not between 1 and {MAX_RATE:g} pictures per second")
        if self.every is not None and self.every < 1:
            raise InputError(f"every: {self.every} is not a number of frames above 0")

    @property
    def rate(self) -> float:
        """Pictures per second."""
        return FRAMES_PER_SECOND if self.fps is None else self.fps

    def frames(self, count: int, frame_time: float) -> np.ndarray:
        """The frames (K,) to show of a trajectory of ``count`` frames that are ``frame_time`` seconds apart.

        Raises:
            InputError: the trajectory has fewer frames a second than the video.
        """
        if self.every is not None:
            return np.arange(0, count, self.every)
        if self.fps is None:
            return choose_frames(count, frame_time)
        interval = 1 / (self.fps * frame_time)  # in frames of the trajectory
        if interval < 1 - _ROUNDING:
            raise InputError(
                f"fps: the trajectory has {1 / frame_time:.4g} frames per second, fewer than {self.fps:g}; "
                "--every 1 shows them all"
            )
        pictures = int((count - 1) / interval + _ROUNDING) + 1
        return np.rint(np.arange(pictures) * interval).astype(int)

    def angles(self, pictures: int) -> np.ndarray:
        """How far the camera has turned in each picture (K,), degrees."""
        return np.arange(pictures) * (360.0 / pictures if self.turntable else 0.0)
