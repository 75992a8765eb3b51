"""Boxes of pixels: the part of a picture that a frame changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_STEP = 32  # pixels; boxes of few sizes, because a window of another size costs time


@dataclass(frozen=True)
class PixelBox:
    """Rows ``top`` to ``bottom`` and columns ``left`` to ``right`` of a picture; the last of each is outside."""

    top: int
    bottom: int
    left: int
    right: int

    @staticmethod
    def around(pixels: np.ndarray, margin: float, size: tuple[int, int]) -> PixelBox:
        """The box around ``pixels`` (N, 2), x and y, with a margin, within a picture of ``size`` (width, height).

        It is at least one step wide and high, also around no pixels and around such outside the picture.
        """
        limits = np.array(size)
        if len(pixels) == 0:
            pixels = np.zeros((1, 2))
        low = np.clip(np.floor((pixels.min(0) - margin) / _STEP) * _STEP, 0, np.maximum(limits - _STEP, 0))
        high = np.minimum(np.maximum(np.ceil((pixels.max(0) + margin) / _STEP) * _STEP, low + _STEP), limits)
        (left, top), (right, bottom) = low.astype(int), high.astype(int)
        return PixelBox(int(top), int(bottom), int(left), int(right))

    @staticmethod
    def whole(size: tuple[int, int]) -> PixelBox:
        """The box of a whole picture of ``size`` (width, height)."""
        return PixelBox(0, size[1], 0, size[0])

    def union(self, other: PixelBox) -> PixelBox:
        """The smallest box around both."""
        return PixelBox(
            min(self.top, other.top), max(self.bottom, other.bottom),
            min(self.left, other.left), max(self.right, other.right),
        )  # fmt: skip

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.right - self.left, self.bottom - self.top

    def slices(self, factor: int = 1) -> tuple[slice, slice]:
        """Rows and columns of the box in an array of the picture with ``factor`` samples a pixel along each axis."""
        return (
            slice(factor * self.top, factor * self.bottom),
            slice(factor * self.left, factor * self.right),
        )
