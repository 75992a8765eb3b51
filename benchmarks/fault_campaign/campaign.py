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

from fault_campaign import kills, learned, meshes, recordings, scenes, surroundings
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

    def rows(
        self, random: np.random.Generator, count: int, inputs: Inputs, work: Path, keep: bool
    ) -> Iterator[dict[str, Any]]:
        """The results."""
        for number, case in enumerate(self.cases(random, count, inputs)):
            yield run_case(case, work / f"{number:04d}", keep)


@dataclass(frozen=True)
class Scenario:
    """A kind of fault in which a run is not alone, see :class:`Kind`."""

    all_rows: Callable[[np.random.Generator, int, Inputs, Path], Iterator[dict[str, Any]]]
    count: int
    short: int

    def rows(
        self, random: np.random.Generator, count: int, inputs: Inputs, work: Path, keep: bool
    ) -> Iterator[dict[str, Any]]:
        """The results."""
        yield from self.all_rows(random, count, inputs, work)


KINDS: dict[str, Kind | Scenario] = {
    "mesh": Kind(lambda random, count, inputs: meshes.cases(random, count), 300, 6),
    "scene": Kind(scenes.cases, 200, 8),
    "learned": Kind(learned.cases, 150, 0),
    "trajectory": Kind(recordings.cases, 150, 6),
    "kill": Scenario(kills.rows, 100, 1),
    "surroundings": Scenario(surroundings.rows, 150, 1),
}


def run_case(case: Case, folder: Path, keep: bool) -> dict[str, Any]:
    """The row of a case in the results."""
    folder.mkdir(parents=True)
    case.prepare(folder)
    before = listing(folder)
    outcome = surfsup(case.arguments, folder, case.before)
    kind, reason = verdict(outcome, case.named)
    new = {path for path in listing(folder) - before if not path.startswith("out")}
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
