"""The options of `surfsup fit`, and what every fit does with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from surfsup.cli.options import Overrides, Resume, Seed, SurfaceFile, Threads, TimeLimit, UpAxis
from surfsup.cli.progress import progress_bar
from surfsup.cli.status import RESUMABLE
from surfsup.errors import Interrupted

if TYPE_CHECKING:
    from surfsup.fitting.fit import Fit, FitConfig
    from surfsup.optim.stopping import Stop

MIN_STEP_SHARE = 0.1  # of all steps; with fewer a fit is only a rough shape

Config = TypeVar("Config", bound="FitConfig")


@dataclass(frozen=True)
class FitOptions:
    """The options that every fit takes; the help texts describe the fields."""

    out: SurfaceFile
    overrides: Overrides = None
    up: UpAxis = None
    time_limit: TimeLimit = ""
    resume: Resume = False
    seed: Seed = 0
    threads: Threads = 1

    def configure(self, kind: type[Config]) -> Config:
        """Set the number of threads and return the configuration of the fit.

        Raises:
            InputError: a key is unknown, or a value is out of range.
        """
        import torch

        from surfsup.optim.config import parse_config, parse_overrides

        torch.set_num_threads(self.threads)
        data = parse_overrides([*(self.overrides or []), f"seed={self.seed}"])
        return parse_config(kind, data, "options of the fit")


def run_and_write(fit: Fit[Any, Any], stop: Stop, resume: bool, write: Callable[[], list[str]]) -> None:
    """Fit until all steps are done or ``stop`` returns True; then write the best weights and print a summary.

    Args:
        fit: the fit.
        stop: stops it early.
        resume: whether to start from the checkpoint.
        write: writes the best weights, also those before a divergence, and returns lines to print.

    Raises:
        InputError: there is no checkpoint to resume from, or there are no weights to write.
        Diverged: the fit diverged; the best weights before it are written.
        Interrupted: the fit was interrupted.
    """
    from surfsup.fitting.fit import run_fit
    from surfsup.fitting.siren_result import NoInside
    from surfsup.optim.run import Diverged

    if resume:
        fit.resume()
    diverged: Diverged | None = None
    lines: list[str] = []
    with stop, progress_bar("fitting", stop) as bar:
        try:
            run_fit(fit, stop, bar.report)
        except Diverged as error:
            diverged = error
        try:
            lines = write() if fit.best else []
        except NoInside as error:
            if diverged is None and not stop.signaled:
                raise
            lines = [str(error)]
    if diverged is not None:
        raise diverged
    for line in lines:
        typer.echo(line)
    typer.echo(f"{fit.step} of {fit.config.steps} steps in {fit.processor_seconds:.0f} s of processor time")
    if fit.step < MIN_STEP_SHARE * fit.config.steps:
        typer.echo("so few steps give a rough shape that is not fit for water: continue with --resume and more --time")
    if stop.signaled:
        raise Interrupted(RESUMABLE)
