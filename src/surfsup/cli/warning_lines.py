"""Warnings as a user sees them."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


def one_line_warnings() -> Callable[..., None]:
    """How warnings are shown to a user: one line each, and each once."""
    told: set[str] = set()

    def show_warning(message: Warning | str, *_: object) -> None:
        if str(message) not in told:
            told.add(str(message))
            sys.stderr.write(f"surfsup: warning: {message}\n")

    return show_warning
