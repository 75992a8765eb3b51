"""How far a run of many simulations is, and how long it will still take."""

from __future__ import annotations

from collections.abc import Callable


class Pace:
    """Counts simulations and tells of them.

    What is left is told from how long one simulation takes, not from how many have ended: they run side by side, and
    all end about when the first does.
    """

    def __init__(self, done: int, count: int, tell: Callable[[int, int, float | None], None] | None) -> None:
        """Begin with ``done`` of ``count``; ``tell`` is told these two and the seconds left, None while not known."""
        self._done, self._count, self._tell = done, count, tell
        self._ended, self._seconds = 0, 0.0
        if tell is not None:
            tell(done, count, None)

    def step(self, seconds: float | None, slots: int) -> None:
        """One more is done, which took so many seconds, None where that is not known; ``slots`` run side by side."""
        self._done += 1
        if seconds is not None:
            self._ended += 1
            self._seconds += seconds
        if self._tell is not None:
            self._tell(self._done, self._count, self.seconds_left(slots))

    def seconds_left(self, slots: int) -> float | None:
        """Until the last will have ended; None where nobody works or none has ended.

        Those now running are on the average half done.
        """
        if slots == 0 or self._ended == 0:
            return None
        left = self._count - self._done
        running = min(left, slots - 1)
        return self._seconds / self._ended * (left - running / 2) / min(slots, max(left, 1))
