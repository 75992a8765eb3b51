"""Several simulations side by side, each advanced by a step in one call."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait

import torch

from surfsup.errors import InputError
from surfsup.simulation import Simulation
from surfsup.simulation_state import Frame, SimulationState


class Worlds:
    """Several simulations, each on one thread at a time.

    The worlds share nothing, so they may have different scenes; each gives what it gives alone.

    Args:
        simulations: the worlds.
        threads: worlds that are computed at the same time; by default as many as torch uses threads.

    Raises:
        InputError: there is no world, one is given twice, or the number of threads is below 1.

    Examples:
        >>> import surfsup as sf
        >>> scene = sf.Scene(fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))])
        >>> worlds = sf.Worlds([sf.Simulation(scene, device="cpu") for _ in range(4)])
        >>> frames = worlds.step()
        >>> len(frames), frames[0].positions.shape
        (4, (125, 3))
    """

    def __init__(self, simulations: Sequence[Simulation], threads: int | None = None) -> None:
        self._simulations = list(simulations)
        if not all(isinstance(simulation, Simulation) for simulation in self._simulations):
            raise InputError("worlds: give a list of simulations, such as [Simulation(scene) for _ in range(16)]")
        if not self._simulations or len(set(map(id, self._simulations))) < len(self._simulations):
            raise InputError("worlds: give one Simulation or more, each of its own")
        threads = torch.get_num_threads() if threads is None else threads
        if threads < 1:
            raise InputError(f"worlds: the number of threads is {threads}, but must be at least 1")
        self._pool = ThreadPoolExecutor(threads, "world", initializer=torch.set_num_threads, initargs=(1,))

    def __len__(self) -> int:
        """Number of worlds."""
        return len(self._simulations)

    def __getitem__(self, number: int) -> Simulation:
        """One of the simulations."""
        return self._simulations[number]

    def __iter__(self) -> Iterator[Simulation]:
        """The simulations in order."""
        return iter(self._simulations)

    @property
    def states(self) -> list[SimulationState]:
        """The present states in order."""
        return [simulation.state for simulation in self._simulations]

    def step(self, steps: int = 1) -> list[Frame]:
        """Advance every world by some frames of its simulator, and return the last frames in order.

        Raises:
            SimulationError: a simulation failed; the others have advanced.
        """
        jobs = [self._pool.submit(advance, simulation, steps) for simulation in self._simulations]
        wait(jobs)  # also of those after one that failed
        return [job.result() for job in jobs]

    def reset(self, states: Sequence[SimulationState] | None = None) -> None:
        """Return every world to an earlier state of its own; by default to its start.

        Raises:
            InputError: there is not one state for each world, or a state is of another scene.
        """
        if states is not None and len(states) != len(self):
            raise InputError(f"worlds: {len(self)} worlds are reset to as many states, not to {len(states)}")
        for number, simulation in enumerate(self._simulations):
            simulation.reset(None if states is None else states[number])


def advance(simulation: Simulation, steps: int) -> Frame:
    """Step a simulation some times."""
    for _ in range(steps - 1):
        simulation.step()
    return simulation.step()
