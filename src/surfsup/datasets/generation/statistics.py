"""Means and standard deviations of a model's inputs and targets, for normalization."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

from surfsup.scene import FRAME_TIME
from surfsup.sph.state import free_fall

QUANTITIES = ("velocity", "velocity_change", "beyond_ballistic")


@dataclass
class Moments:
    """Sums and sums of squares over the particles and frames of one simulation, without the first frame.

    The quantities are ``velocity`` (m/s, at the end of a frame), ``velocity_change`` (m/s, over a frame) and
    ``beyond_ballistic`` (meters: the displacement of a frame less that of a free fall from its start).

    Attributes:
        samples: number of particles times frames.
        sums: quantity -> its sum (3,) along x, y and z.
        squares: quantity -> the sum of its squares (3,).
    """

    samples: int = 0
    sums: dict[str, np.ndarray] = field(default_factory=lambda: {name: np.zeros(3) for name in QUANTITIES})
    squares: dict[str, np.ndarray] = field(default_factory=lambda: {name: np.zeros(3) for name in QUANTITIES})

    def add(self, name: str, values: np.ndarray) -> None:
        """Add ``values`` (K, 3, N) of a quantity. NumPy's sums along memory are pairwise, which keeps them precise."""
        self.sums[name] += values.sum(axis=2).sum(axis=0)
        self.squares[name] += np.square(values).sum(axis=2).sum(axis=0)

    def to_attributes(self) -> dict[str, object]:
        """As attributes of a trajectory file."""
        attributes: dict[str, object] = {"samples": self.samples}
        for name in QUANTITIES:
            attributes[f"{name}_sum"], attributes[f"{name}_squares"] = self.sums[name], self.squares[name]
        return attributes

    @classmethod
    def from_attributes(cls, attributes: Mapping[str, Any]) -> Moments:
        """Read the result of :meth:`to_attributes`.

        Raises:
            KeyError: an attribute is missing.
            ValueError: one is not three finite numbers.
        """
        sums, squares = (
            {name: np.asarray(attributes[f"{name}_{of}"]) for name in QUANTITIES} for of in ("sum", "squares")
        )
        for values in (*sums.values(), *squares.values()):
            if values.shape != (3,) or values.dtype.kind != "f" or not np.isfinite(values).all():
                raise ValueError("its statistics are not three finite numbers for each quantity")
        return cls(int(attributes["samples"]), sums, squares)


class MomentAccumulator:
    """Accumulates the moments of one simulation, frame by frame."""

    def __init__(self, gravity: tuple[float, float, float]) -> None:
        """Start empty; ``gravity`` in m/s² determines the free fall."""
        self.moments = Moments()
        self._fall = free_fall(torch.tensor(gravity, dtype=torch.float64)).numpy()[:, None]
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def update(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Add the next frames: positions (K, 3, N) in meters and velocities (K, 3, N) in m/s, float64.

        Particles that are not in the scene have NaN.
        """
        if self._last is not None:
            last_positions, last_velocities = self._last
            positions = np.concatenate([last_positions, positions])
            velocities = np.concatenate([last_velocities, velocities])
        self._last = positions[-1:], velocities[-1:]
        if len(positions) == 1:
            return
        ballistic = FRAME_TIME * velocities[:-1] + self._fall
        change, beyond = np.diff(velocities, axis=0), np.diff(positions, axis=0) - ballistic
        quantities = {"velocity": velocities[1:], "velocity_change": change, "beyond_ballistic": beyond}
        self.moments.samples += (len(positions) - 1) * positions.shape[2]
        if not np.isfinite(beyond).all():  # particles that are not in both frames do not count
            both = np.isfinite(beyond).all(axis=1, keepdims=True)
            self.moments.samples -= int((~both).sum())
            quantities = {name: np.where(both, values, 0.0) for name, values in quantities.items()}
        for name, values in quantities.items():
            self.moments.add(name, values)


def normalization_statistics(scenes: Iterable[Moments]) -> dict[str, object]:
    """Mean and standard deviation of each quantity along x, y and z over all ``scenes``.

    Returns:
        ``samples``, and for each quantity ``mean`` and ``standard_deviation`` as lists of three numbers. They depend
        on the order of the scenes by rounding only.
    """
    total = Moments()
    for scene in scenes:
        total.samples += scene.samples
        for name in QUANTITIES:
            total.sums[name] += scene.sums[name]
            total.squares[name] += scene.squares[name]
    statistics: dict[str, object] = {"samples": total.samples}
    for name in QUANTITIES:
        mean = total.sums[name] / max(1, total.samples)
        variance = total.squares[name] / max(1, total.samples) - mean**2
        deviation = np.sqrt(np.maximum(variance, 0))
        statistics[name] = {"mean": rounded(mean), "standard_deviation": rounded(deviation)}
    return statistics


def rounded(values: np.ndarray) -> list[float]:
    """The values with seven significant digits, the precision of float32."""
    return [float(f"{value:.7g}") for value in values]
