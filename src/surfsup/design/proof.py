"""The solver's verdict: does a design do in SPlisHSPlasH what the learned simulator promised?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from surfsup.design.landing import settled
from surfsup.design.parameter import Values
from surfsup.design.reward import NothingLanded, Outcome
from surfsup.design.rollout import every_frame
from surfsup.design.shape_files import write_shape
from surfsup.design.task import Task
from surfsup.io.trajectory import Provenance, TrajectoryWriter
from surfsup.learned.corrected.simulator import CorrectedSimulator
from surfsup.scene import Scene, Shape, Start
from surfsup.scene.shapes import MeshShape
from surfsup.sph.state import Environment
from surfsup.splishsplash import solver

Frames = Iterator[tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Verdict:
    """The rewards of one design.

    Attributes:
        learned: by the learned simulator.
        true: by the reference solver; None where the reward is undefined there, as when nothing lands.
    """

    learned: float
    true: float | None


def judged(task: Task, values: Values, simulator: CorrectedSimulator, model: str, folder: Path) -> Verdict:
    """Run a design in both simulators, and keep shape and trajectories in ``folder``.

    Raises:
        InputError: the solver is not installed, or the shape is not closed.
        SolverError: the solver stopped.
    """
    folder.mkdir(parents=True, exist_ok=True)
    water = task.water()
    with torch.no_grad():
        surface = task.surface(values, water)
        write_shape(surface, folder, "shape")
        scene = task.scene.model_copy(update={"surface": Shape(mesh=MeshShape(file=Path("shape.obj")))})
        scene = scene.in_folder(folder)
        learned = kept(learned_frames(task, values, simulator), scene, folder / "learned.h5", model)
        true = kept(true_frames(task, values), scene, folder / "solver.h5", solver.NAME)
        # The learned frames hold those who landed where they did; so only the solver's need to be settled.
        scores = [score(task, values, frames) for frames in (learned, true)]
    if scores[0] is None:
        raise NothingLanded("no particle reached the floor in the learned simulator")
    return Verdict(scores[0], scores[1])


def true_reward(task: Task, values: Values) -> float | None:
    """The reward by the solver alone; None where it is undefined."""
    with torch.no_grad():
        return score(task, values, true_frames(task, values))


def score(task: Task, values: Values, frames: Frames) -> float | None:
    """The reward of a simulation's frames; None where nothing landed that should."""
    positions, landed = settled(frames, task.floor)
    try:
        return float(task.score(Outcome(positions, landed, values)))
    except NothingLanded:
        return None


def learned_frames(task: Task, values: Values, simulator: CorrectedSimulator) -> Frames:
    """Positions and velocities (N, 3) of each frame; who has landed stays where it did."""
    water = task.water()
    environment = Environment.of(task.scene, task.surface(values, water))
    for fluid in every_frame(simulator, environment, water, task.scene.frames - 1):
        velocities = torch.zeros_like(fluid.positions).index_copy(0, fluid.members, fluid.state.velocities)
        yield fluid.positions.numpy(), velocities.numpy()


def true_frames(task: Task, values: Values) -> Frames:
    """The same by the reference solver, in which nothing leaves."""
    start: Start = task.scene.start(None)
    yield from solver.simulate(task.scene, task.surface(values, task.water()), start)


def kept(frames: Frames, scene: Scene, path: Path, model: str) -> Frames:
    """The frames as they come, written to ``path`` too."""
    first = next(frames)
    with TrajectoryWriter(path, scene, Provenance(model), len(first[0])) as writer:
        writer.append(*first)
        yield first
        for frame in frames:
            writer.append(*frame)
            yield frame
