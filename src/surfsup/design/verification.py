"""Verification: does a design also score better in the reference solver, SPlisHSPlasH?"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from surfsup.design.folder import write_text
from surfsup.design.parameter import Values
from surfsup.design.reward import NothingLanded, Outcome
from surfsup.design.rollout import all_frames, crossing_point
from surfsup.design.run import DesignRun
from surfsup.design.shape_files import write_shape
from surfsup.design.task import Task
from surfsup.io.trajectory_format import Provenance
from surfsup.io.trajectory_writer import TrajectoryWriter
from surfsup.scene import Scene, Shape
from surfsup.scene.shapes import MeshShape
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import ParticleState
from surfsup.splishsplash import solver as reference_solver

Frames = Iterator[tuple[np.ndarray, np.ndarray]]
SIMULATOR_NAME = "dfsph"


@dataclass(frozen=True)
class Rewards:
    """The rewards of one design.

    Attributes:
        dfsph: by the DFSPH solver of the optimization.
        reference: by the reference solver; None where the reward is undefined there, for example if nothing lands.
    """

    dfsph: float
    reference: float | None


@dataclass(frozen=True)
class Verification:
    """The first and the best design in both solvers.

    Attributes:
        first, best: their rewards.
    """

    first: Rewards
    best: Rewards

    @property
    def passed(self) -> bool:
        """Whether the best design scores higher than the first in the reference solver, too."""
        if self.best.reference is None:
            return False
        return self.first.reference is None or self.best.reference > self.first.reference

    def text(self) -> str:
        """Two lines for a terminal."""

        def number(reward: float | None) -> str:
            return "undefined" if reward is None else f"{reward:.4f}"

        result = (
            "passed: the reference solver, too, scores the best design higher than the first"
            if self.passed
            else "FAILED: the reference solver does not score the best design higher than the first"
        )
        return (
            f"reference     first {number(self.first.reference)} (dfsph {number(self.first.dfsph)}), "
            f"best {number(self.best.reference)} (dfsph {number(self.best.dfsph)})\nverification  {result}"
        )


def verify(run: DesignRun, progress: Callable[[int, int], None] = lambda done, total: None) -> Verification:
    """Run the first and the best design in the reference solver.

    ``verification.json`` and a folder for each design with its shape and trajectories stay in the run's folder.

    Args:
        run: a finished run.
        progress: called with the number of designs done and their total.

    Raises:
        InputError: the reference solver is not installed, or a shape is not watertight.
        SolverError: the reference solver stopped.
    """
    rewards = []
    for done, (label, number) in enumerate((("first", 0), ("best", run.best)), start=1):
        rewards.append(compare_solvers(run.task, run.designs[number], run.simulator, run.folder / label))
        progress(done, 2)
    verification = Verification(*rewards)
    content = {**asdict(verification), "passed": verification.passed}
    write_text(run.folder / "verification.json", json.dumps(content, indent=2) + "\n")
    return verification


def compare_solvers(task: Task, values: Values, simulator: Simulator[ParticleState], folder: Path) -> Rewards:
    """The rewards of a design in both solvers. Its shape and both trajectories are written to ``folder``.

    Raises:
        InputError: as :func:`verify`.
        SolverError: the reference solver stopped.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with torch.no_grad():
        write_shape(task.surface(values, task.initial_state()), folder, "shape")
        scene = task.scene.model_copy(update={"surface": Shape(mesh=MeshShape(file=Path("shape.obj")))})
        scene = scene.with_base_folder(folder)
        ours = recorded(simulated_frames(task, values, simulator), scene, folder / "dfsph.h5", SIMULATOR_NAME)
        theirs = recorded(reference_frames(task, values), scene, folder / "reference.h5", reference_solver.NAME)
        dfsph, reference = (score_frames(task, values, frames) for frames in (ours, theirs))
    if dfsph is None:
        raise NothingLanded("no particle reached the floor in the DFSPH solver")
    return Rewards(dfsph, reference)


def reference_reward(task: Task, values: Values) -> float | None:
    """The reward by the reference solver; None where it is undefined."""
    with torch.no_grad():
        return score_frames(task, values, reference_frames(task, values))


def score_frames(task: Task, values: Values, frames: Frames) -> float | None:
    """The reward of a trajectory; None if it needs landed particles and there are none."""
    positions, landed = final_positions((positions for positions, _ in frames), task.floor)
    try:
        return float(task.score(Outcome(positions, landed, values)))
    except NothingLanded:
        return None


def final_positions(frames: Iterable[np.ndarray], floor: float | None) -> tuple[Tensor, Tensor]:
    """The last positions (N, 3) in meters, and which particles (N,) have landed, of a solver in which none leave.

    A landed particle keeps the position where it first reached the floor.

    Args:
        frames: positions (N, 3) of each frame, meters.
        floor: height in meters at which particles land; None for no floor.
    """
    last = landed = None
    for positions in frames:
        now = torch.from_numpy(positions)
        if last is None or landed is None:
            last, landed = now, torch.zeros(len(now), dtype=torch.bool)
            continue
        lands = torch.zeros_like(landed) if floor is None else ~landed & (now[:, 2] <= floor)
        reached = now if floor is None else torch.where(lands[:, None], crossing_point(last, now, floor), now)
        last, landed = torch.where(landed[:, None], last, reached), landed | lands
    if last is None or landed is None:
        raise ValueError("there are no frames")
    return last, landed


def simulated_frames(task: Task, values: Values, simulator: Simulator[ParticleState]) -> Frames:
    """Positions and velocities (N, 3) of each frame by our simulator; landed particles stay where they landed."""
    start = task.initial_state()
    for particles in all_frames(simulator, task.environment(values, start), start, task.scene.frames - 1, task.floor):
        at_rest = torch.zeros_like(particles.positions)
        velocities = at_rest.index_copy(0, particles.active, particles.state.velocities)
        yield particles.positions.numpy(), velocities.numpy()


def reference_frames(task: Task, values: Values) -> Frames:
    """The same by the reference solver, in which landed particles are still simulated."""
    surface = task.surface(values, task.initial_state())
    yield from reference_solver.simulate(task.scene, surface, task.scene.initial_particles(None))


def recorded(frames: Frames, scene: Scene, path: Path, simulator: str) -> Frames:
    """The same frames, also written to ``path``."""
    first = next(frames)
    with TrajectoryWriter(path, scene, Provenance(simulator), len(first[0])) as writer:
        writer.append(*first)
        yield first
        for frame in frames:
            writer.append(*frame)
            yield frame
