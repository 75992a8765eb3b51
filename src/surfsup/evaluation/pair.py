"""Two trajectory files of one scene, one judged by the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from surfsup.datasets.units import check_units
from surfsup.errors import InputError
from surfsup.evaluation.evaluate import Judgment, judge_file
from surfsup.evaluation.floor import HOW_TO_MAKE
from surfsup.evaluation.load_trajectories import Skipped, difference, usable_floors
from surfsup.evaluation.report import definitions, judgment_entry
from surfsup.evaluation.table import judgment_text
from surfsup.io.trajectory import Trajectory
from surfsup.scene import NEAR_SURFACE_DISTANCE


@dataclass(frozen=True)
class Pair:
    """One trajectory judged by another.

    Attributes:
        judged, truth: their files.
        threshold: meters; particles nearer to the solid count for Chamfer Surface.
        judgment: how the first came off.
        remarks: what a reader must know beside the numbers, a line each.
        skipped: repeats of the truth that could not be used.
    """

    judged: Path
    truth: Path
    threshold: float
    judgment: Judgment
    remarks: list[str]
    skipped: list[Skipped]

    def text(self) -> str:
        """The numbers for a terminal."""
        left_out = [f"skipped {bad.file}: {bad.reason}" for bad in self.skipped]
        return "\n".join([*self.remarks, *left_out, "", judgment_text(self.judgment)])

    def report(self) -> dict:
        """All numbers and curves as plain data for JSON; what is called model there is the judged file."""
        return {
            "judged": str(self.judged),
            "truth": str(self.truth),
            "remarks": self.remarks,
            "skipped": [{"file": str(bad.file), "reason": bad.reason} for bad in self.skipped],
            **definitions(self.threshold),
            **judgment_entry(self.judgment),
        }


def judge_pair(
    judged: Path,
    truth: Path,
    threshold: float = NEAR_SURFACE_DISTANCE,
    tell: Callable[[int, int], None] = lambda done, total: None,
) -> Pair:
    """Judge the trajectory file ``judged`` by the one of ``truth``, over the frames that both have.

    Raises:
        InputError: a file is not a trajectory, has no frames, is damaged or of another frame time or particle radius,
            or they are of different scenes.
    """
    with Trajectory(judged) as one, Trajectory(truth) as other:
        check_units(judged, one)
        check_units(truth, other)
        differing = difference(one.scene, other.scene)
        if differing is not None:
            raise InputError(f"{judged} and {truth} are of different scenes: their {differing} differ")
        frames = min(len(one), len(other))
        if frames == 0:
            raise InputError(f"{judged if len(one) == 0 else truth}: has no frames")
        remarks = [f"{judged} ({one.provenance.simulator}) judged by {truth} ({other.provenance.simulator})"]
        if len(one) != len(other):
            remarks.append(f"{len(one)} frames and {len(other)}: the first {frames}, which both have, are compared")
        counts = one.positions.shape[1], other.positions.shape[1]
        if counts[0] != counts[1]:
            remarks.append(f"{counts[0]} particles and {counts[1]}")
        skipped: list[Skipped] = []
        floors = usable_floors(truth, other.scene, frames, skipped)
        if not floors:
            remarks.append(f"no floor beside {truth.name} ({HOW_TO_MAKE.format(truth.parent)})")
    return Pair(judged, truth, threshold, judge_file(judged, truth, floors, threshold, tell), remarks, skipped)
