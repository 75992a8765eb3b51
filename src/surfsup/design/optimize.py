"""Design optimization in one call."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from surfsup.design import folder as run_folder
from surfsup.design.history import process_cpu_seconds
from surfsup.design.run import DesignRun
from surfsup.design.task import Task, format_values
from surfsup.errors import InputError, SimulationError
from surfsup.io.output_folder import writable_folder

SAVE_INTERVAL = 5.0  # seconds


@dataclass(frozen=True)
class Progress:
    """The progress of a run.

    Attributes:
        iteration, iterations: number done and total.
        reward: of the last evaluated design.
        values: that design, in words.
        seconds_left: estimate of the remaining time.
    """

    iteration: int
    iterations: int
    reward: float
    values: str
    seconds_left: float


def optimize(
    task: Task,
    folder: str | Path,
    iterations: int = 100,
    smoothing: float = 0.0,
    seed: int = 0,
    resume: bool = False,
    should_stop: Callable[[], bool] = lambda: False,
    report: Callable[[Progress], None] = lambda progress: None,
) -> DesignRun:
    """Optimize the parameters of ``task`` by gradients through the DFSPH solver.

    Args:
        task: what to design.
        folder: where to save the run; created if it does not exist.
        iterations: maximum number of steps.
        smoothing: meters by which the fluid's start is shifted at random in each iteration.
        seed: of the random numbers.
        resume: continue the run in the folder, if there is one; a finished run is only read.
        should_stop: called before each iteration; the run stops if it returns True.
        report: called after each iteration.

    Returns:
        The run, with its designs, rewards and the index of the best.

    Raises:
        InputError: the task or the folder cannot be used; see :meth:`DesignRun.iterate`.
        SimulationError: the simulation diverged.
    """
    run = DesignRun(task, writable_folder(Path(folder)), iterations, smoothing, seed)
    if resume and run.files.exist():
        run_folder.resume(run)
    elif run.files.exist():
        raise InputError(f"{folder}: contains a design already; use --resume (resume=True) or another folder")
    run_to_end(run, should_stop, report)
    return run


def run_to_end(run: DesignRun, should_stop: Callable[[], bool], report: Callable[[Progress], None]) -> None:
    """Iterate until the run is done or ``should_stop``. The run is saved even after an error.

    Raises:
        InputError, SimulationError: as :meth:`DesignRun.iterate`.
    """
    saved = time.monotonic()
    try:
        while not run.done and not should_stop():
            wall, cpu = time.monotonic(), process_cpu_seconds()
            run.iterate()
            run.wall_seconds += time.monotonic() - wall
            run.cpu_seconds += process_cpu_seconds() - cpu
            evaluated, iterations = len(run.rewards), run.optimizer.iterations
            seconds_left = run.wall_seconds / evaluated * (iterations + 1 - evaluated)
            values = format_values(run.designs[-1])
            report(Progress(run.optimizer.iteration, iterations, run.rewards[-1], values, seconds_left))
            if time.monotonic() - saved > SAVE_INTERVAL:
                run_folder.save(run)
                saved = time.monotonic()
    except (InputError, SimulationError) as error:
        if not run.rewards:
            raise
        raise type(error)(
            f"{error} (iteration {run.optimizer.iteration}; the best design so far is saved in {run.folder})"
        ) from None
    finally:
        if run.rewards:
            run_folder.save(run)
