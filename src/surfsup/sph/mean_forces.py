"""Forces between frames that do not coincide with steps: the mean over the time since the frame before."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from surfsup.scene.wrench import Wrench


class MeanForces:
    """The forces of steps, from which means over other intervals follow. Time is in steps; step k ends at k."""

    def __init__(self) -> None:
        self._steps: list[tuple[int, Mapping[str, Wrench]]] = []

    def add(self, step: int, forces: Mapping[str, Wrench]) -> None:
        """Add the forces of the step that ends at ``step``."""
        self._steps.append((step, forces))

    def mean(self, since: float, until: float) -> dict[str, Wrench]:
        """The mean forces by name in an interval, which the known steps cover; forgets those that end in it."""
        weights = [max(0.0, min(step, until) - max(step - 1, since)) for step, _ in self._steps]
        total = sum(weights)
        names = self._steps[-1][1] if total > 0 else {}
        result = {}
        for name in names:
            pairs = zip(weights, self._steps, strict=True)
            rows = np.sum([weight * np.stack(forces[name]) for weight, (_, forces) in pairs], axis=0) / total
            result[name] = Wrench(*rows)
        self._steps = [pair for pair in self._steps if pair[0] > until]
        return result
