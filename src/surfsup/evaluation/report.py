"""A model judged on a folder of held-out trajectories."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from surfsup import __version__
from surfsup.errors import InputError
from surfsup.evaluation.judge import Scores, mean_scores, rollout_scores
from surfsup.model.simulator import Simulator
from surfsup.trajectory import Trajectory

SPANS = (300, 800)  # frames: fall, impact and splash; and all with the pool at rest


@dataclass(frozen=True)
class SceneScores:
    """The scores of one scene over the first frames and over all.

    Attributes:
        scene: the trajectory's file name.
        kind: of surface.
        spans: number of frames -> scores.
    """

    scene: str
    kind: str
    spans: dict[int, Scores]


def trajectories_in(folder: Path) -> list[Path]:
    """The trajectory files of ``folder``.

    Raises:
        InputError: it has none.
    """
    paths = sorted(folder.glob("*.h5"))
    if not paths:
        raise InputError(f"{folder}: has no trajectories (*.h5) to judge by; make some with 'surfsup generate'")
    return paths


def report_folder(path: Path) -> None:
    """Make the folder that the report goes into.

    Raises:
        InputError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: cannot be made ({error.strerror}); give another folder with -o") from None


def evaluate(model: Simulator, paths: list[Path], guarded: bool, tell: Callable[[int, int], None]) -> list[SceneScores]:
    """Roll ``model`` out beside every trajectory of ``paths``."""
    scored = []
    for done, path in enumerate(paths, start=1):
        with Trajectory(path) as truth:
            spans = rollout_scores(model, truth, SPANS, guarded=guarded)
            kind = truth.scene.surface.kind if truth.scene.surface else "none"
        scored.append(SceneScores(path.name, kind, spans))
        tell(done, len(paths))
    return scored


def means(scored: list[SceneScores]) -> dict[int, Scores]:
    """Means over the scenes, for each span."""
    return {span: mean_scores([scene.spans[span] for scene in scored]) for span in scored[0].spans}


def write_report(path: Path, model: str, folder: Path, scored: list[SceneScores]) -> None:
    """Write every scene's scores and their means as JSON."""
    report = {
        "model": model,
        "data": folder.name,
        "version": __version__,
        "mean": {span: asdict(scores) for span, scores in means(scored).items()},
        "scenes": [asdict(scene) for scene in scored],
    }
    path.write_text(json.dumps(report, indent=2) + "\n")


def table(scored: list[SceneScores]) -> str:
    """The scores of every scene and their means as a text table."""
    head = (
        f"{'scene':<14}{'surface':<10}{'frames':>7}{'Chamfer':>9}{'squared':>10}{'height':>9}{'energy':>8}"
        f"{'inside':>8}{'outside':>8}{'guarded':>9}"
    )
    lines = [head]
    for span in scored[0].spans:
        lines += [row(scene.scene, scene.kind, span, scene.spans[span]) for scene in scored]
        lines += [row("mean", "", span, means(scored)[span]), ""]
    lines.append(
        "Chamfer: plain, m; squared: m²; height: mean error of the centre of mass, m; energy: kinetic, summed, "
        "predicted over true;"
    )
    lines.append("inside, outside: particles summed over frames; guarded: share of particles moved in a frame")
    return "\n".join(lines)


def row(scene: str, kind: str, span: int, scores: Scores) -> str:
    """One line of the table."""
    return (
        f"{scene:<14}{kind:<10}{span:>7}{scores.chamfer:>9.4f}{scores.chamfer_squared:>10.6f}"
        f"{scores.height_error:>9.4f}{scores.energy_ratio:>8.3f}{scores.inside:>8}{scores.outside:>8}"
        f"{scores.guarded:>9.5f}"
    )
