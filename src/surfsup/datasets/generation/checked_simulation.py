"""One simulation by the reference solver, checked while it runs."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from itertools import islice
from typing import TypeVar

import numpy as np

from surfsup.datasets.generation.physical_check import PhysicalCheck, UnphysicalError
from surfsup.datasets.generation.scene_sampler import SceneSampler
from surfsup.datasets.generation.statistics import MomentAccumulator, Moments
from surfsup.errors import SimulationError
from surfsup.scene import InitialParticles, Scene
from surfsup.scene.solids import Solids, build_solids
from surfsup.scene.start import entering_particles
from surfsup.scene.tap_checks import check_taps_and_drains
from surfsup.splishsplash import solver

MAX_DRAWS = 5  # scenes drawn for one index before an error
FRAMES_PER_CHECK = 8  # many small NumPy calls cost more than the data: eight frames at once are three times as fast
SOLVER_RUNS = 2  # of one scene if the solver stops early: the fault may be the machine's

T = TypeVar("T")


class NoValidSceneError(SimulationError):
    """None of the scenes drawn for an index could be simulated. The message is one line."""


class CheckedSimulation:
    """The frames of one scene. Iterating over them runs the simulation and checks it.

    Attributes:
        scene: the scene.
        solids: of the scene.
        rejections: reasons why earlier scenes of the same index were rejected, one line each.
        moments: of the frames so far, for the statistics of the data set, in the units of the simulators.
    """

    def __init__(
        self,
        scene: Scene,
        solids: Solids,
        start: InitialParticles,
        rejections: tuple[str, ...] = (),
    ) -> None:
        self.scene, self.rejections = scene, rejections
        self.moments = Moments()
        self.solids, self._start = solids, start

    @property
    def particles(self) -> int:
        """Number of particles that are ever in the scene."""
        return len(self._start.positions) + entering_particles(self.scene)

    def __iter__(self) -> Generator[tuple[np.ndarray, np.ndarray], None, None]:
        """Positions (N, 3) in meters and velocities (N, 3) in m/s of each frame, float32; NaN outside the scene.

        Raises:
            UnphysicalError: the simulation is not physical.
            SolverError: the solver stopped early.
        """
        check, accumulator = PhysicalCheck(self.scene, self.solids), MomentAccumulator(self.scene.gravity)
        self.moments = accumulator.moments
        with closing(solver.simulate(self.scene, self.solids.still, self._start)) as frames:
            while batch := list(islice(frames, FRAMES_PER_CHECK)):
                positions, velocities = (
                    np.ascontiguousarray(np.stack(part).swapaxes(1, 2), float)
                    for part in zip(*(self.scene.units.frame_to_solver(*frame) for frame in batch), strict=True)
                )
                check.check(positions, velocities)
                accumulator.update(positions, velocities)
                yield from batch


def simulate_valid_scene(sampler: SceneSampler, index: int, consume: Callable[[CheckedSimulation], T]) -> T:
    """Simulate scene ``index``. If its simulation fails or is not physical, draw another scene for the index.

    Args:
        sampler: draws the scenes.
        index: of the scene.
        consume: iterates over the frames; it is called again for each run of the solver.

    Returns:
        The result of ``consume`` for the first simulation that is physical to its end.

    Raises:
        NoValidSceneError: no scene of this index could be simulated.
        InputError: the solver or a file is missing.
    """
    rejections: list[str] = []
    while len(rejections) < MAX_DRAWS:
        scene = sampler.scene(index, attempt=len(rejections))
        solids = build_solids(scene)
        check_taps_and_drains(scene, solids)
        start = scene.initial_particles(solids.at_time(0.0))
        simulation = CheckedSimulation(scene, solids, start, tuple(rejections))
        try:
            return with_retry(simulation, consume)
        except (UnphysicalError, solver.SolverError) as error:
            rejections.append(str(error))
            sampler.discard(scene)
    raise NoValidSceneError(f"scene {index}: {MAX_DRAWS} in a row were rejected, the last because {rejections[-1]}")


def with_retry(simulation: CheckedSimulation, consume: Callable[[CheckedSimulation], T]) -> T:
    """The result of ``consume(simulation)``, with a second run if the solver stops early.

    Raises:
        UnphysicalError: the simulation is not physical.
        SolverError: the solver stopped early every time.
    """
    for _ in range(SOLVER_RUNS - 1):
        try:
            return consume(simulation)
        except solver.SolverError:
            continue
    return consume(simulation)
