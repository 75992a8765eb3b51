"""A design from one call: the task in, the run with its folder out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from surfsup.design import folder as run_folder
from surfsup.design.climb import Progress, climb
from surfsup.design.run import DesignRun
from surfsup.design.task import Task
from surfsup.errors import InputError
from surfsup.io.output_folder import writable_folder
from surfsup.learned import weights_file


def quiet(progress: Progress) -> None:
    """Tells nothing."""


def never() -> bool:
    """Does not stop."""
    return False


def optimize(
    task: Task,
    folder: str | Path,
    iterations: int = 100,
    model: str = weights_file.DEFAULT_MODEL,
    smoothing: float | None = None,
    seed: int = 0,
    resume: bool = False,
    stop: Callable[[], bool] = never,
    tell: Callable[[Progress], None] = quiet,
) -> DesignRun:
    """Move the parameters of ``task`` uphill by the gradients of a learned simulator.

    Args:
        task: what to design.
        folder: where the run is kept; made if it is not there.
        iterations: steps uphill.
        model: a shipped model's name, or a weights file.
        smoothing: meters by which the water's start is moved aside at random in each iteration; None leaves it to the
            task.
        seed: of those moves.
        resume: go on with the run in the folder, if one is there; a finished one is only read.
        stop: asked before each iteration whether to end here.
        tell: called after each iteration.

    Returns:
        The run: its rewards and designs, the number of the best.

    Raises:
        InputError: something of task or folder cannot be used; see :class:`DesignRun`.
        SimulationError: the simulation blew up.
    """
    run = DesignRun(
        task,
        writable_folder(Path(folder)),
        weights_file.load(weights_file.find(model))[0],
        model,
        iterations,
        smoothing,
        seed,
    )
    if resume and run.files.exist():
        run_folder.resume(run)
    elif run.files.exist():
        raise InputError(f"{folder}: holds a design already; go on with --resume (resume=True) or take another folder")
    climb(run, stop, tell)
    return run
