"""What takes long before any progress is shown: reading meshes, computing their grids and maps.

A library does not print. So work announces itself here, and a program that wants to show it says how.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Reporter = Callable[[str], AbstractContextManager[object]]

reporter: Reporter = nullcontext  # shows nothing


def activity(text: str) -> AbstractContextManager[object]:
    """A block of work that may take seconds; ``text`` says which, such as "reading bunny.obj"."""
    return reporter(text)


def report_activities(new: Reporter) -> None:
    """Let ``new`` show every activity from now on: a function from its text to a context around it."""
    global reporter
    reporter = new
