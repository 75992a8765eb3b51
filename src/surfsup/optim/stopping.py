"""When a run stops by itself: its time is up, Ctrl-C, or SIGTERM."""

from __future__ import annotations

import math
import signal
import time
from types import FrameType, TracebackType

SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stop:
    """Whether to stop now. As a context manager it listens to Ctrl-C and SIGTERM; a second one ends at once.

    Attributes:
        signaled: whether a signal asked for it.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self._end = time.monotonic() + seconds
        self._before: list[object] = []
        self.signaled = False

    def __call__(self) -> bool:
        """Whether the time is up or a signal came."""
        return self.signaled or time.monotonic() >= self._end

    def _hear(self, number: int, frame: FrameType | None) -> None:
        if self.signaled:
            raise KeyboardInterrupt
        self.signaled = True

    def __enter__(self) -> Stop:
        self._before = [signal.signal(number, self._hear) for number in SIGNALS]
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        for number, handler in zip(SIGNALS, self._before, strict=True):
            signal.signal(number, handler)
