"""A line on standard error for each activity that takes more than two seconds, so that no wait is silent."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

FIRST_LINE, LINE_EVERY = 2.0, 10.0  # seconds


@contextmanager
def activity_lines(text: str) -> Iterator[None]:
    """Print ``text`` after two seconds of the block, and again with the time every ten seconds."""
    ended = threading.Event()
    began = time.monotonic()

    def print_lines() -> None:
        wait, line = FIRST_LINE, f"{text} ..."
        while not ended.wait(wait):
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()
            wait = LINE_EVERY
            line = f"{text}: {time.monotonic() - began + wait:.0f} s so far"

    thread = threading.Thread(target=print_lines, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
