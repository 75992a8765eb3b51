"""When a run stops early: after a time limit, on Ctrl-C, or on SIGTERM."""

from __future__ import annotations

import math
import signal
import time
from types import FrameType, TracebackType
from typing import Any

from surfsup.errors import InputError

SIGNALS = (signal.SIGINT, signal.SIGTERM)
UNITS = {"s": 1, "m": 60, "h": 3600}  # seconds


class Stop:
    """A stop condition: call it to learn whether to stop now.

    The time limit counts from the first call. A run calls right before its first step, so preparation costs none of it.

    As a context manager it handles Ctrl-C and SIGTERM: the first signal requests a stop, the second raises
    KeyboardInterrupt.

    Attributes:
        signaled: whether a signal requested the stop.
    """

    def __init__(self, seconds: float = math.inf) -> None:
        self._seconds = seconds
        self._deadline: float | None = None
        self._previous_handlers: list[Any] = []
        self.signaled = False

    def __call__(self) -> bool:
        """Whether the time limit has passed or a signal has arrived."""
        now = time.monotonic()
        if self._deadline is None:
            self._deadline = now + self._seconds
        return self.signaled or now >= self._deadline

    @property
    def seconds_left(self) -> float:
        """Until the time limit; infinite without one."""
        return self._seconds if self._deadline is None else self._deadline - time.monotonic()

    def _handle_signal(self, number: int, frame: FrameType | None) -> None:
        if self.signaled:
            raise KeyboardInterrupt
        self.signaled = True

    def __enter__(self) -> Stop:
        self._previous_handlers = [signal.signal(number, self._handle_signal) for number in SIGNALS]
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        for number, handler in zip(SIGNALS, self._previous_handlers, strict=True):
            signal.signal(number, handler)


def parse_duration(text: str) -> float:
    """A duration such as ``90s``, ``30m`` or ``1.5h`` in seconds.

    Raises:
        InputError: the text has another form, or the duration is not above zero.
    """
    try:
        seconds = float(text[:-1]) * UNITS[text[-1]]
    except (KeyError, ValueError, IndexError):
        seconds = 0.0
    if not 0 < seconds < math.inf:
        raise InputError(f"'{text}' is not a length of time; write for example 90s, 30m or 1.5h")
    return seconds
