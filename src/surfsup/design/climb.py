"""A design run from where it is to its end, kept so that it can stop at any moment and go on as if it had not."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from surfsup.design.folder import save
from surfsup.design.record import processor_seconds
from surfsup.design.run import DesignRun
from surfsup.design.task import told
from surfsup.errors import InputError, SimulationError

SECONDS_A_SAVE = 5.0


@dataclass(frozen=True)
class Progress:
    """Where a run is.

    Attributes:
        iteration, iterations: done, and how many there will be.
        reward: of the last design that was looked at.
        values: the design now, in words.
        seconds_left: until the last iteration, at the pace so far.
    """

    iteration: int
    iterations: int
    reward: float
    values: str
    seconds_left: float


def climb(run: DesignRun, stop: Callable[[], bool], tell: Callable[[Progress], None]) -> None:
    """Iterate until all is done or ``stop`` says so; whatever happens, what was found is kept.

    Raises:
        InputError: the reward is no number or does not depend on the shape, the shape is in the water's way or
            leaves the container, nothing lands where that is asked for.
        SimulationError: the simulation blew up.
    """
    saved = time.monotonic()
    try:
        while not run.done and not stop():
            began, worked = time.monotonic(), processor_seconds()
            run.iterate()
            run.seconds += time.monotonic() - began
            run.work += processor_seconds() - worked
            left = run.seconds / len(run.rewards) * (run.ascent.iterations + 1 - len(run.rewards))
            now = told(run.ascent.values)
            tell(Progress(run.ascent.iteration, run.ascent.iterations, run.rewards[-1], now, left))
            if time.monotonic() - saved > SECONDS_A_SAVE:
                save(run)
                saved = time.monotonic()
    except (InputError, SimulationError) as error:
        if not run.rewards:
            raise
        raise type(error)(
            f"{error} (iteration {run.ascent.iteration}; the best design so far is kept in {run.folder})"
        ) from None
    finally:
        if run.rewards:
            save(run)
