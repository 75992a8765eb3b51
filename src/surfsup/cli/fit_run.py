"""How every fit begins and ends, whatever is fitted."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import typer

from surfsup.cli.progress import fitting_line
from surfsup.cli.status import INTERRUPTED
from surfsup.errors import InputError

if TYPE_CHECKING:
    from surfsup.fitting.fit import Fit
    from surfsup.optim.stopping import Stop


def stop_after(time_limit: str) -> Stop:
    """When to stop: ``time_limit`` from now, never where it is empty.

    Raises:
        InputError: the limit is no time.
    """
    from surfsup.optim.stopping import Stop
    from surfsup.training.config import seconds_of

    return Stop(seconds_of(time_limit) if time_limit else float("inf"))


def carry_out(fitting: Fit, stop: Stop, resume: bool, write: Callable[[], list[str]]) -> None:
    """Fit until it is done or to be stopped, then write and tell what was reached.

    Args:
        fitting: what is fitted.
        stop: of :func:`stop_after`.
        resume: whether to go on from the checkpoint.
        write: writes the best that there is, also of a fit that diverged; returns what is to be told of it.

    Raises:
        InputError: there is no checkpoint to go on from, or nothing was reached that could be written.
        Diverged: the fit got worse instead of better; the best before is written.
        typer.Exit: it was interrupted.
    """
    from surfsup.fitting.loop import Diverged, run
    from surfsup.fitting.siren_result import NothingInside

    if resume:
        fitting.resume()
    failed: Diverged | None = None
    told: list[str] = []
    with stop, fitting_line() as tell:
        try:
            run(fitting, stop, tell)
        except Diverged as error:
            failed = error
        try:
            told = write() if fitting.best else []
        except NothingInside as error:
            if failed is None and not stop.signaled:
                raise
            told = [str(error)]
    if failed is not None:
        raise failed
    for line in told:
        typer.echo(line)
    typer.echo(f"{fitting.step} of {fitting.config.steps} steps in {fitting.processor_seconds:.0f} s of processor time")
    if stop.signaled:
        raise typer.Exit(INTERRUPTED)
    if not fitting.best:
        raise InputError("there was no time for a single step; give more --time")
