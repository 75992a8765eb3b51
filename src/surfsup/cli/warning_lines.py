"""Warnings as the command line prints them."""

from __future__ import annotations

import sys
from collections.abc import Callable

from surfsup.errors import printable


def one_line_warnings() -> Callable[..., None]:
    """A replacement for ``warnings.showwarning`` that prints each warning once, as one line."""
    shown: set[str] = set()

    def show_warning(message: Warning | str, *_: object) -> None:
        if str(message) not in shown:
            shown.add(str(message))
            sys.stderr.write(f"surfsup: warning: {printable(str(message))}\n")

    return show_warning
