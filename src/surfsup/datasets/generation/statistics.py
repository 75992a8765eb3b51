"""Means and standard deviations of what a model sees and predicts, for normalizing."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import torch

from surfsup.scene import FRAME_TIME
from surfsup.sph.state import free_fall_drop

QUANTITIES = ("velocity", "velocity_change", "beyond_ballistic")


@dataclass
class Sums:
    """Sums over the particles and frames of one simulation, the first frame left out.

    Attributes:
        samples: particles times frames.
        sums: quantity -> its sum (3,), an entry an axis.
        squares: quantity -> the sum of its squares (3,).

    The quantities are ``velocity`` (m/s, at the end of a frame), ``velocity_change`` (m/s, over a frame) and
    ``beyond_ballistic`` (meters: the displacement of a frame less what a free fall from its start would give).
    """

    samples: int = 0
    sums: dict[str, np.ndarray] = field(default_factory=lambda: {name: np.zeros(3) for name in QUANTITIES})
    squares: dict[str, np.ndarray] = field(default_factory=lambda: {name: np.zeros(3) for name in QUANTITIES})

    def add(self, name: str, values: np.ndarray) -> None:
        """Add ``values`` (K, 3, N) of the quantity ``name``; NumPy's sums along memory are pairwise, so precise."""
        self.sums[name] += values.sum(axis=2).sum(axis=0)
        self.squares[name] += np.square(values).sum(axis=2).sum(axis=0)

    def to_notes(self) -> dict[str, object]:
        """As numbers and arrays that a trajectory file can hold."""
        notes: dict[str, object] = {"samples": self.samples}
        for name in QUANTITIES:
            notes[f"{name}_sum"], notes[f"{name}_squares"] = self.sums[name], self.squares[name]
        return notes

    @classmethod
    def from_notes(cls, notes: Mapping[str, object]) -> Sums:
        """What :meth:`to_notes` gave.

        Raises:
            KeyError: something is missing.
        """
        return cls(
            int(notes["samples"]),
            {name: np.asarray(notes[f"{name}_sum"]) for name in QUANTITIES},
            {name: np.asarray(notes[f"{name}_squares"]) for name in QUANTITIES},
        )


class Tally:
    """Adds up the frames of one simulation as they come."""

    def __init__(self, gravity: tuple[float, float, float]) -> None:
        """Start with nothing; ``gravity`` in m/s² shapes the free fall."""
        self.sums = Sums()
        self._drop = free_fall_drop(torch.tensor(gravity, dtype=torch.float64)).numpy()[:, None]
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def look_at(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Add the next frames: positions (K, 3, N) in meters and velocities (K, 3, N) in m/s, float64."""
        if self._last is not None:
            last_positions, last_velocities = self._last
            positions = np.concatenate([last_positions, positions])
            velocities = np.concatenate([last_velocities, velocities])
        self._last = positions[-1:], velocities[-1:]
        if len(positions) == 1:
            return
        falls = FRAME_TIME * velocities[:-1] + self._drop
        self.sums.samples += (len(positions) - 1) * positions.shape[2]
        self.sums.add("velocity", velocities[1:])
        self.sums.add("velocity_change", np.diff(velocities, axis=0))
        self.sums.add("beyond_ballistic", np.diff(positions, axis=0) - falls)


def normalization(scenes: Iterable[Sums]) -> dict[str, object]:
    """Mean and standard deviation of each quantity along x, y and z over ``scenes``, added up in their order.

    Returns:
        ``samples``, and for each quantity ``mean`` and ``standard_deviation`` as lists of three numbers.
    """
    total = Sums()
    for scene in scenes:
        total.samples += scene.samples
        for name in QUANTITIES:
            total.sums[name] += scene.sums[name]
            total.squares[name] += scene.squares[name]
    said: dict[str, object] = {"samples": total.samples}
    for name in QUANTITIES:
        mean = total.sums[name] / max(1, total.samples)
        variance = total.squares[name] / max(1, total.samples) - mean**2
        deviation = np.sqrt(np.maximum(variance, 0))
        said[name] = {"mean": rounded(mean), "standard_deviation": rounded(deviation)}
    return said


def rounded(values: np.ndarray) -> list[float]:
    """Seven digits, which is what single precision holds."""
    return [float(f"{value:.7g}") for value in values]
