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
        self._rounds: deque[tuple[float, float, bool]] = (
            deque()
        )  # clock, simulated seconds, whether there was a picture

    def count(self, now: float, simulated: float, drawn: bool = True) -> None:
        """Note the simulated seconds since the last call at a time of the clock, and whether a picture was drawn."""
        self._rounds.append((now, simulated, drawn))
        while self._rounds[0][0] < now - WINDOW:
            self._rounds.popleft()

    @property
    def pictures(self) -> float:
        """Pictures per second."""
        return self._per_second(float(sum(drawn for _, _, drawn in list(self._rounds)[1:])))

    @property
    def speed(self) -> float:
        """Simulated seconds per second; 1 is real time."""
        return self._per_second(sum(simulated for _, simulated, _ in list(self._rounds)[1:]))

    def _per_second(self, amount: float) -> float:
        if len(self._rounds) < 2:
            return 0.0
        return amount / max(self._rounds[-1][0] - self._rounds[0][0], 1e-9)
