"""The kinds of faults with their numbers of runs, and what happens to one of them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fault_campaign import learned, meshes, recordings, scenes
from fault_campaign.inputs import Inputs
from fault_campaign.program import call, surfsup
from fault_campaign.verdict import BAD, Case, verdict


@dataclass(frozen=True)
class Kind:
    """A kind of fault.

    Attributes:
        cases: those of a random generator, in this number, with these inputs.
        count, short: numbers of the whole campaign and of its short form.
    """

    cases: Callable[[np.random.Generator, int, Inputs], Iterator[Case]]
    count: int
    short: int


KINDS = {
    "mesh": Kind(lambda random, count, inputs: meshes.cases(random, count), 300, 6),
    "scene": Kind(scenes.cases, 200, 8),
    "learned": Kind(learned.cases, 150, 0),
    "trajectory": Kind(recordings.cases, 150, 8),
}


def run_case(case: Case, folder: Path, keep: bool) -> dict[str, Any]:
    """The row of a case in the results."""
    folder.mkdir()
    case.prepare(folder)
    before = listing(folder)
    outcome = surfsup(case.arguments, folder, case.before)
    kind, reason = verdict(outcome, case.named)
    new = {path for path in listing(folder) - before if path.split("/")[0] != "out"}
    if new and kind not in BAD:
        kind, reason = "wrote elsewhere", ", ".join(sorted(new))
    if kind == "accepted" and case.check is not None and (wrong := call(partial(case.check, folder))):
        kind, reason = "silently wrong", wrong
    if not (keep and kind in BAD):
        shutil.rmtree(folder)
    reason = reason.replace(f"{folder}{os.sep}", "")
    return {
        "kind": case.kind,
        "name": case.name,
        "outcome": kind,
        "reason": reason,
        "seconds": round(outcome.seconds, 1),
    }


def listing(folder: Path) -> set[str]:
    """The paths below a folder."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}
