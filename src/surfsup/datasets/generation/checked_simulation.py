"""One simulation by the reference solver, checked while it runs."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from itertools import islice
from typing import TypeVar

import numpy as np

from surfsup.datasets.generation.physical_check import Check, UnphysicalError
from surfsup.datasets.generation.scene_sampler import Drawing
from surfsup.datasets.generation.statistics import Sums, Tally
from surfsup.errors import SimulationError
from surfsup.scene import InitialParticles, Scene
from surfsup.sdf import Surface
from surfsup.splishsplash import solver

DRAWS = 5  # scenes drawn for one index before it is given up
FRAMES_AT_ONCE = 8
TRIES = 2  # of one scene at which the solver stops: the machine may have failed it, not the scene

T = TypeVar("T")


class GivenUpError(SimulationError):
    """None of the scenes drawn for an index could be simulated; the message is one line."""


class Run:
    """The frames of one scene; going through them simulates it.

    Attributes:
        scene: what is simulated.
        attempt: how many scenes were drawn in its place before.
        set_aside: why those were not taken, one line each.
        sums: of the frames gone through, for the statistics of the data set.
    """

    def __init__(
        self,
        scene: Scene,
        surface: Surface | None,
        start: InitialParticles,
        set_aside: tuple[str, ...] = (),
    ) -> None:
        self.scene, self.set_aside = scene, set_aside
        self.sums = Sums()
        self._surface, self._start = surface, start

    @property
    def attempt(self) -> int:
        """How many scenes were drawn in its place before."""
        return len(self.set_aside)

    @property
    def particles(self) -> int:
        """How many there are."""
        return len(self._start.positions)

    def __iter__(self) -> Generator[tuple[np.ndarray, np.ndarray], None, None]:
        """Positions (N, 3) in meters and velocities (N, 3) in m/s of each frame, float32.

        Raises:
            UnphysicalError: no fluid does what this one did.
            SolverError: the solver stopped early.
        """
        check, tally = Check(self.scene, self._surface), Tally(self.scene.gravity)
        self.sums = tally.sums
        with closing(solver.simulate(self.scene, self._surface, self._start)) as frames:
            # Many small steps over little data cost more than the data: eight frames at once are three times as fast.
            while some := list(islice(frames, FRAMES_AT_ONCE)):
                rows = [np.ascontiguousarray(np.stack(part).swapaxes(1, 2), float) for part in zip(*some, strict=True)]
                check.look_at(*rows)
                tally.look_at(*rows)
                yield from some


def simulate_sound(drawing: Drawing, index: int, take: Callable[[Run], T]) -> T:
    """Simulate scene ``index``; one whose simulation fails or is not physical is replaced by the next drawn.

    Args:
        drawing: where scenes come from.
        index: of the scene.
        take: goes through a run's frames; called anew for every try.

    Returns:
        What ``take`` made of the first run that is sound to its end.

    Raises:
        GivenUpError: no scene of this index could be simulated.
        InputError: the solver or a file is missing.
    """
    reasons: list[str] = []
    while len(reasons) < DRAWS:
        scene = drawing.scene(index, attempt=len(reasons))
        surface = scene.build_surface()
        run = Run(scene, surface, scene.initial_particles(surface), tuple(reasons))
        try:
            return patiently(run, take)
        except (UnphysicalError, solver.SolverError) as error:
            reasons.append(str(error))
            drawing.set_aside(scene)
    raise GivenUpError(f"scene {index}: {DRAWS} in a row were set aside, the last because {reasons[-1]}")


def patiently(run: Run, take: Callable[[Run], T]) -> T:
    """What ``take`` makes of ``run``, which gets a second try when the solver stops.

    Raises:
        UnphysicalError: no fluid does what this one did.
        SolverError: the solver stopped every time.
    """
    for _ in range(TRIES - 1):
        try:
            return take(run)
        except solver.SolverError:
            continue
    return take(run)
