"""The kinds of faults with their numbers of runs, and what happens to one of them."""

from __future__ import annotations

import os
import re
import shutil
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fault_campaign import data_sets, kills, learned, meshes, recordings, scenes, surroundings
from fault_campaign.inputs import Inputs
from fault_campaign.program import call, surfsup
from fault_campaign.verdict import BAD, Case, verdict

Run = tuple[str, str, Callable[[Path], tuple[str, str]]]  # kind, name, and what happens in a folder


@dataclass(frozen=True)
class Choice:
    """Which cases are tried.

    Attributes:
        names: a regular expression that their names match.
        done: numbers of those that an earlier leg has tried.
        keep: whether the folders of faults stay.
    """

    names: str = ""
    done: Collection[int] = ()
    keep: bool = False

    def takes(self, number: int, name: str) -> bool:
        """Whether a case is tried."""
        return number not in self.done and re.search(self.names, name) is not None


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
        self, random: np.random.Generator, count: int, inputs: Inputs, work: Path, choice: Choice
    ) -> Iterator[dict[str, Any]]:
        """The results of the cases that are chosen."""
        for number, case in enumerate(self.cases(random, count, inputs)):
            if choice.takes(number, case.name):
                yield {"number": number, **run_case(case, work / f"{number:04d}", choice.keep)}


@dataclass(frozen=True)
class Scenario:
    """A kind of fault in which a run is not alone, see :class:`Kind`."""

    runs: Callable[[np.random.Generator, int, Inputs], Iterator[Run]]
    count: int
    short: int

    def rows(
        self, random: np.random.Generator, count: int, inputs: Inputs, work: Path, choice: Choice
    ) -> Iterator[dict[str, Any]]:
        """The results of the runs that are chosen."""
        for number, (kind, name, run) in enumerate(self.runs(random, count, inputs)):
            if not choice.takes(number, name):
                continue
            folder = work / f"{number:04d}"
            folder.mkdir(parents=True)
            began = time.monotonic()
            outcome, reason = run(folder)
            seconds = round(time.monotonic() - began, 1)
            yield {
                "number": number, "kind": kind, "name": name, "outcome": outcome, "reason": reason, "seconds": seconds
            }  # fmt: skip


KINDS: dict[str, Kind | Scenario] = {
    "mesh": Kind(lambda random, count, inputs: meshes.cases(random, count), 300, 6),
    "scene": Kind(scenes.cases, 200, 8),
    "learned": Kind(learned.cases, 150, 0),
    "trajectory": Kind(recordings.cases, 150, 6),
    "kill": Scenario(kills.runs, 100, 1),
    "surroundings": Scenario(surroundings.runs, 175, 1),
    "data set": Kind(data_sets.cases, 100, 0),
}


def run_case(case: Case, folder: Path, keep: bool) -> dict[str, Any]:
    """The row of a case in the results."""
    folder.mkdir(parents=True)
    case.prepare(folder)
    before = listing(folder)
    outcome = surfsup(case.arguments, folder, case.before)
    kind, reason = verdict(outcome, case.named)
    new = {path for path, _ in listing(folder) ^ before if not path.startswith("out")}
    if new and kind not in BAD:
        kind, reason = "wrote elsewhere", ", ".join(sorted(new))
    if kind in ("accepted", "warned") and case.check is not None and (wrong := call(partial(case.check, folder))):
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


def listing(folder: Path) -> set[tuple[str, tuple[int, int]]]:
    """The paths below a folder, with size and time of last change of those that are files."""
    paths = {str(path.relative_to(folder)): path for path in folder.rglob("*")}
    status = {name: path.lstat() for name, path in paths.items()}
    return {(name, (one.st_size, one.st_mtime_ns) if paths[name].is_file() else (0, 0)) for name, one in status.items()}
