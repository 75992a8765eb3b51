"""A model judged beside true trajectories, and beside the floor where there is one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from surfsup.errors import InputError
from surfsup.evaluation.compare import Comparison, compare
from surfsup.evaluation.load_trajectories import Truth
from surfsup.evaluation.rollout import roll_out
from surfsup.evaluation.scores import ByWindow, mean_scores, scores
from surfsup.io.trajectory import Trajectory
from surfsup.scene import NEAR_SURFACE_DISTANCE
from surfsup.sph.simulator import Simulator

ROLLOUTS = "trajectories"  # folder in the report


@dataclass(frozen=True)
class Judgment:
    """A trajectory and the repeats of the truth, each beside the truth.

    Attributes:
        surface: kind of solid, 'none' in an empty container.
        particles: of the truth.
        own: the trajectory that is judged.
        floors: the truth's repeats.
        scores: of the trajectory.
        floor: mean of the repeats; empty where there are none.
    """

    surface: str
    particles: int
    own: Comparison
    floors: list[Comparison]
    scores: ByWindow
    floor: ByWindow


@dataclass(frozen=True)
class JudgedScene:
    """One scene of a data set, judged.

    Attributes:
        truth: what it was judged by.
        rollout: the model's trajectory file.
        handle_collisions: share of particles that the guard moved in a frame.
        judgment: how the rollout came off.
    """

    truth: Truth
    rollout: Path
    handle_collisions: float
    judgment: Judgment

    @property
    def name(self) -> str:
        """Of the scene, in its data set."""
        return self.truth.path.stem


def judge_file(
    path: Path,
    truth: Path,
    floors: Sequence[Path] = (),
    threshold: float = NEAR_SURFACE_DISTANCE,
    tell: Callable[[int, int], None] = lambda done, total: None,
) -> Judgment:
    """Judge the trajectory in ``path`` by the one in ``truth``, over the frames that all files have.

    Args:
        path, truth: two trajectories of one scene.
        floors: repeats of the truth.
        threshold: meters; particles nearer to the solid count for Chamfer Surface.
        tell: told how many frames are done.

    Raises:
        InputError: a file is not a trajectory or is damaged, or the scene's mesh is not usable.
    """
    with ExitStack() as files:
        opened = [files.enter_context(Trajectory(file)) for file in (truth, path, *floors)]
        try:
            own, *repeats = compare(opened[0], opened[1:], threshold, tell)
        except OSError as error:
            raise InputError(f"{path} or {truth}: is damaged ({' '.join(str(error).split())})") from None
        shape, particles = opened[0].scene.surface, opened[0].positions.shape[1]
    floor = mean_scores([scores(repeat) for repeat in repeats])
    return Judgment(shape.kind if shape else "none", particles, own, repeats, scores(own), floor)


def evaluate(
    model: Simulator,
    name: str,
    truths: Sequence[Truth],
    report: Path,
    device: str,
    handle_collisions: bool = True,
    threshold: float = NEAR_SURFACE_DISTANCE,
    tell: Callable[[int, int], None] = lambda done, total: None,
) -> list[JudgedScene]:
    """Roll ``model`` out beside every one of ``truths`` and judge it.

    Args:
        model: the simulator.
        name: of the model.
        truths: what to judge by; see :func:`surfsup.evaluation.load_trajectories.usable_truths`.
        report: folder whose subfolder ``trajectories`` takes the rollouts.
        device: where the model computes.
        handle_collisions: whether the guard against penetration is on.
        threshold: meters; particles nearer to the solid count for Chamfer Surface.
        tell: told how many frames of all are done.

    Raises:
        InputError: a rollout cannot be written.
    """
    judged, done, total = [], 0, sum(truth.frames for truth in truths)
    for truth in truths:
        path = report / ROLLOUTS / truth.data / truth.path.name
        path.parent.mkdir(parents=True, exist_ok=True)

        def told(frame: int, before: int = done) -> None:
            tell(before + frame, total)

        with Trajectory(truth.path) as beside:
            guard_share = roll_out(model, beside, truth.frames, path, name, device, handle_collisions, told)
        judged.append(JudgedScene(truth, path, guard_share, judge_file(path, truth.path, truth.floors, threshold)))
        done += truth.frames
    return judged
