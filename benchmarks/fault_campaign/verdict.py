"""What an outcome is worth: fine, refused as it should be, or one of the kinds that may not occur."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from fault_campaign.program import Outcome

GOOD = ("accepted", "warned", "refused", "failed in one line", "interrupted", "killed")
BAD = (
    "traceback",
    "signal",
    "hang",
    "unclear message",
    "control characters",
    "silently wrong",
    "lost or half-written",
    "wrote elsewhere",
)
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
PREFIX = "surfsup: "
WARNING = "surfsup: warning: "


@dataclass(frozen=True)
class Case:
    """A damaged input and what to do with it.

    Attributes:
        kind: of the input, such as "mesh".
        name: of the damage.
        arguments: of `surfsup`, in a folder of the case.
        prepare: writes the input into that folder.
        check: of an accepted input: what is wrong with the result in the folder, or nothing. It runs in a child.
        named: text that a refusal must contain, such as the name of the file.
        before: called in the child before surfsup.
    """

    kind: str
    name: str
    arguments: Sequence[object]
    prepare: Callable[[Path], None]
    check: Callable[[Path], str] | None = None
    named: str = ""
    before: Callable[[], None] | None = None


def verdict(outcome: Outcome, named: str = "") -> tuple[str, str]:
    """The kind of an outcome, and the line that says why."""
    lines = [line for line in outcome.errors.splitlines() if line.startswith(PREFIX)]
    warnings = [line for line in lines if line.startswith(WARNING)]
    messages = [line for line in lines if not line.startswith(WARNING)]
    last = outcome.errors.rstrip().splitlines()[-1] if outcome.errors.strip() else ""
    if outcome.timed_out:
        return "hang", f"{outcome.seconds:.0f} s"
    if "Traceback (most recent call last)" in outcome.errors:
        return "traceback", last
    if outcome.status < 0:
        return "signal", f"signal {-outcome.status}"
    if CONTROL.search(outcome.errors) or CONTROL.search(outcome.printed.replace("\r", "")):
        return "control characters", last
    if outcome.status == 0:
        return ("warned", warnings[0]) if warnings else ("accepted", "")
    if outcome.status == 130:
        return "interrupted", last
    if outcome.status == 2 and warnings and not messages:  # what a damaged file still holds was written
        return "warned", warnings[0]
    # A sweep names each scene that failed in a line.
    cases = bool(messages) and all(line.startswith(f"{PREFIX}scene-") for line in messages)
    one_line = cases or (len(messages) == 1 and outcome.errors.endswith(messages[0] + "\n"))
    if outcome.status not in (1, 2) or not one_line:
        return "unclear message", f"status {outcome.status}: {last or 'silence'}"
    if outcome.status == 1:
        return "failed in one line", messages[0]
    if named and named not in messages[0]:
        return "unclear message", f"does not name {named}: {messages[0]}"
    return "refused", messages[0]
