"""The exit statuses of the program other than 0, and what an interrupt leaves."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from surfsup.errors import Interrupted

FAULT = 1
BAD_INPUT = 2
INTERRUPTED = 130

RESUMABLE = "finished work is kept; the same command with --resume continues"


@contextmanager
def after_interrupt(kept: str) -> Iterator[None]:
    """Let an interrupt of the block say what is ``kept``, unless a more exact message exists already.

    Raises:
        Interrupted: the user interrupted the block.
    """
    try:
        yield
    except KeyboardInterrupt:
        raise Interrupted(kept) from None
