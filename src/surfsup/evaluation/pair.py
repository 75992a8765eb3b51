"""Evaluation of one trajectory file against another of the same scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from surfsup.datasets.units import check_same_units
from surfsup.errors import InputError
from surfsup.evaluation.evaluate import Evaluation, evaluate_trajectory
from surfsup.evaluation.floor import FLOOR_HINT
from surfsup.evaluation.load_trajectories import SkippedFile, load_floors, scene_difference
from surfsup.evaluation.report import Json, definitions, evaluation_entry
from surfsup.evaluation.table import trajectory_text
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_path import trajectory_path
from surfsup.scene import NEAR_SURFACE_DISTANCE


@dataclass(frozen=True)
class PairEvaluation:
    """One trajectory file evaluated against another.

    Attributes:
        prediction, reference: the files.
        threshold: meters; particles closer to the solid count for Chamfer Surface.
        frame_time: seconds between frames.
        evaluation: of the prediction.
        remarks: notes for the reader of the numbers, a line each.
        skipped: repeats of the reference that are not valid.
    """

    prediction: Path
    reference: Path
    threshold: float
    frame_time: float
    evaluation: Evaluation
    remarks: list[str]
    skipped: list[SkippedFile]

    def text(self) -> str:
        """The numbers for a terminal."""
        skipped = [f"skipped {bad.file}: {bad.reason}" for bad in self.skipped]
        return "\n".join([*self.remarks, *skipped, "", trajectory_text(self.evaluation)])

    def report(self) -> Json:
        """All numbers and curves as plain data for JSON."""
        return {
            "prediction": str(self.prediction),
            "reference": str(self.reference),
            "remarks": self.remarks,
            "skipped": [{"file": str(bad.file), "reason": bad.reason} for bad in self.skipped],
            **definitions(self.threshold, self.frame_time),
            **evaluation_entry(self.evaluation),
        }


def evaluate_pair(
    prediction: str | Path,
    reference: str | Path,
    threshold: float | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> PairEvaluation:
    """Evaluate the trajectory file ``prediction`` against ``reference``, over the frames that both have.

    Args:
        prediction: a trajectory file, or the folder with it.
        reference: another one of the same scene.
        threshold: meters; particles closer to the solid count for Chamfer Surface. Six particle radii by default.
        progress: called with the numbers of finished and of all frames.

    Raises:
        InputError: a file is not a trajectory, has no frames, is damaged, or the files differ in frame time,
            particle radius or scene.

    Examples:
        >>> import surfsup as sf
        >>> scene = sf.Scene(fluid=[sf.Block((-0.1, -0.1, 0.1), (0.1, 0.1, 0.3))], frames=20)
        >>> sf.Simulation(scene).record("solver.h5")
        >>> sf.Simulation(scene, simulator="surfsup").record("network.h5")
        >>> print(sf.evaluate("network.h5", "solver.h5").text())
        network.h5 (surfsup) against solver.h5 (dfsph)...
    """
    prediction, reference = trajectory_path(prediction), trajectory_path(reference)
    with Trajectory(prediction) as one, Trajectory(reference) as other:
        check_same_units((reference, prediction), (other, one))
        frame_time = other.frame_time
        threshold = NEAR_SURFACE_DISTANCE * other.scene.units.length if threshold is None else threshold
        difference = scene_difference(one.scene, other.scene)
        if difference is not None:
            raise InputError(f"{prediction} and {reference} are of different scenes: their {difference} differ")
        frames = min(len(one), len(other))
        if frames == 0:
            raise InputError(f"{prediction if len(one) == 0 else reference}: has no frames")
        for path, trajectory in ((prediction, one), (reference, other)):
            if trajectory.positions.shape[1] == 0:
                raise InputError(f"{path}: has no particles")
        remarks = [f"{prediction} ({one.provenance.simulator}) against {reference} ({other.provenance.simulator})"]
        if len(one) != len(other):
            remarks.append(f"{len(one)} frames and {len(other)}: the first {frames}, which both have, are compared")
        counts = one.positions.shape[1], other.positions.shape[1]
        if counts[0] != counts[1]:
            remarks.append(f"{counts[0]} particles and {counts[1]}")
        floors, skipped = load_floors(reference, other.scene, frames)
        if not floors:
            remarks.append(f"no floor beside {reference.name} ({FLOOR_HINT.format(reference.parent)})")
    evaluation = evaluate_trajectory(prediction, reference, floors, threshold, progress)
    return PairEvaluation(prediction, reference, threshold, frame_time, evaluation, remarks, skipped)
