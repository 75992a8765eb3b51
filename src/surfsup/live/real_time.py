"""Real time: whether a step is due, and the rates that were reached."""

from __future__ import annotations

from collections import deque

LAG = 0.1  # seconds behind real time beyond which lost time is given up
WINDOW = 1.0  # seconds over which rates are measured


class RealTime:
    """Keeps simulated time with the clock.

    Args:
        frame_time: seconds of a step.
        now: seconds of the clock.

    Attributes:
        frame_time: seconds of a step.
        next: when the next step is due, seconds of the clock.
    """

    def __init__(self, frame_time: float, now: float) -> None:
        self.frame_time, self.next = frame_time, now

    def due(self, now: float) -> bool:
        """Whether a step is due; the clock then waits for the next one.

        A simulation that is slower than real time does not try to catch up: it would never draw a picture again.
        """
        if now < self.next:
            return False
        self.next = max(self.next, now - LAG) + self.frame_time
        return True

    def restart(self, now: float) -> None:
        """Continue from now on, after a pause."""
        self.next = now


class Rates:
    """Pictures per second and simulated seconds per second, over the last second."""

    def __init__(self) -> None:
        self._pictures: deque[tuple[float, float]] = deque()  # clock and simulated seconds

    def count(self, now: float, simulated: float) -> None:
        """Note a picture at a time of the clock, with the simulated seconds since the one before."""
        self._pictures.append((now, simulated))
        while self._pictures[0][0] < now - WINDOW:
            self._pictures.popleft()

    @property
    def pictures(self) -> float:
        """Pictures per second."""
        return self._per_second(float(len(self._pictures) - 1))

    @property
    def speed(self) -> float:
        """Simulated seconds per second; 1 is real time."""
        return self._per_second(sum(simulated for _, simulated in list(self._pictures)[1:]))

    def _per_second(self, amount: float) -> float:
        if len(self._pictures) < 2:
            return 0.0
        return amount / max(self._pictures[-1][0] - self._pictures[0][0], 1e-9)
