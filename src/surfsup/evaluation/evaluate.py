"""Evaluation of a simulator against reference trajectories and their reproducibility floor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from surfsup.errors import InputError, single_line
from surfsup.evaluation.compare import Comparison, compare
from surfsup.evaluation.load_trajectories import ReferenceTrajectory
from surfsup.evaluation.rollout import write_rollout
from surfsup.evaluation.scores import WindowScores, compute_scores, mean_scores
from surfsup.io.trajectory import Trajectory
from surfsup.scene import NEAR_SURFACE_DISTANCE
from surfsup.sph.simulator import Simulator

ROLLOUT_FOLDER = "trajectories"  # in the report


@dataclass(frozen=True)
class Evaluation:
    """A predicted trajectory and the repeats of the reference, each compared with the reference.

    Attributes:
        surface: kind of solid, 'none' in an empty container.
        particles: number in the reference.
        comparison: of the prediction.
        floor_comparisons: of the reference's repeats.
        scores: of the prediction.
        floor: mean scores of the repeats; empty without repeats.
    """

    surface: str
    particles: int
    comparison: Comparison
    floor_comparisons: list[Comparison]
    scores: WindowScores
    floor: WindowScores

    @property
    def reached_solid(self) -> bool:
        """Whether a particle of the prediction or of the reference ever came near the solid."""
        both = (self.comparison.prediction, self.comparison.reference)
        return any(bool((statistics.near > 0).any()) for statistics in both)


@dataclass(frozen=True)
class EvaluatedScene:
    """One evaluated scene of a data set.

    Attributes:
        reference: its reference trajectory.
        rollout: trajectory file of the simulator.
        collided_share: share of particles that collision handling moved, mean over frames.
        evaluation: of the rollout.
    """

    reference: ReferenceTrajectory
    rollout: Path
    collided_share: float
    evaluation: Evaluation

    @property
    def name(self) -> str:
        """Name of the scene in its data set."""
        return self.reference.path.stem


def evaluate_trajectory(
    prediction: Path,
    reference: Path,
    floors: Sequence[Path] = (),
    threshold: float = NEAR_SURFACE_DISTANCE,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Evaluation:
    """Evaluate the trajectory file ``prediction`` against ``reference``, over the frames that all files have.

    Args:
        prediction, reference: two trajectories of one scene.
        floors: repeats of the reference.
        threshold: meters; particles closer to the solid count for Chamfer Surface.
        progress: called with the numbers of finished and of all frames.

    Raises:
        InputError: a file is not a trajectory or is damaged, or the scene's mesh is not valid.
    """
    with ExitStack() as files:
        opened = [files.enter_context(Trajectory(file)) for file in (reference, prediction, *floors)]
        try:
            comparison, *repeats = compare(opened[0], opened[1:], threshold, progress)
        except OSError as error:
            raise InputError(f"{prediction} or {reference}: is damaged ({single_line(error)})") from None
        surface, particles = opened[0].scene.surface_kind, opened[0].positions.shape[1]
    floor = mean_scores([compute_scores(repeat) for repeat in repeats])
    return Evaluation(surface, particles, comparison, repeats, compute_scores(comparison), floor)


def evaluate(
    simulator: Simulator,
    name: str,
    references: Sequence[ReferenceTrajectory],
    report: Path,
    device: str = "cpu",
    handle_collisions: bool = True,
    threshold: float = NEAR_SURFACE_DISTANCE,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[EvaluatedScene]:
    """Roll ``simulator`` out from the start of each of ``references`` and evaluate the rollouts.

    Args:
        simulator: the simulator.
        name: of the simulator.
        references: see :func:`surfsup.evaluation.load_trajectories.load_references`.
        report: folder whose subfolder ``trajectories`` receives the rollouts.
        device: where to compute.
        handle_collisions: whether collision handling keeps particles out of the solid.
        threshold: meters; particles closer to the solid count for Chamfer Surface.
        progress: called with the numbers of finished and of all frames.

    Raises:
        InputError: a rollout cannot be written.
    """
    scenes, done, total = [], 0, sum(reference.frames for reference in references)
    for reference in references:
        path = report / ROLLOUT_FOLDER / reference.data_set / reference.path.name
        path.parent.mkdir(parents=True, exist_ok=True)

        def frame_done(frame: int, before: int = done) -> None:
            progress(before + frame, total)

        with Trajectory(reference.path) as trajectory:
            collided_share = write_rollout(
                path, simulator, name, trajectory, reference.frames, device, handle_collisions, frame_done
            )
        evaluation = evaluate_trajectory(path, reference.path, reference.floors, threshold)
        scenes.append(EvaluatedScene(reference, path, collided_share, evaluation))
        done += reference.frames
    return scenes
