"""The progress of many simulations, and the time until the last one ends."""

from __future__ import annotations

from collections.abc import Callable


class ProgressEstimate:
    """Counts finished simulations and reports the count and the remaining time.

    The estimate uses the duration of one simulation, not the rate at which they end: simulations run side by side and
    all end at about the same time as the first.
    """

    def __init__(self, done: int, count: int, report: Callable[[int, int, float | None], None] | None) -> None:
        """Start with ``done`` of ``count``; ``report`` gets both and the remaining seconds, None if unknown."""
        self._done, self._count, self._report = done, count, report
        self._timed, self._seconds = 0, 0.0
        if report is not None:
            report(done, count, None)

    def step(self, seconds: float | None, slots: int) -> None:
        """Count one more simulation.

        Args:
            seconds: its duration; None if unknown.
            slots: number of simulations that run side by side.
        """
        self._done += 1
        if seconds is not None:
            self._timed += 1
            self._seconds += seconds
        if self._report is not None:
            self._report(self._done, self._count, self.seconds_left(slots))

    def seconds_left(self, slots: int) -> float | None:
        """Seconds until the last simulation ends; None without workers or before the first has ended.

        The estimate takes the running simulations to be half done on average.
        """
        if slots == 0 or self._timed == 0:
            return None
        left = self._count - self._done
        running = min(left, slots - 1)
        return self._seconds / self._timed * (left - running / 2) / min(slots, max(left, 1))
