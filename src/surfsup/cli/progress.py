"""What a terminal shows while something takes long; on standard error, and only once something is done."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import ProgressColumn

    from surfsup.design.run import Progress as DesignProgress
    from surfsup.fitting.loop import Progress as FitProgress
    from surfsup.training.train import Progress


@contextmanager
def bar(what: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on standard error, from the first thing done on, that says how long it still takes."""
    from rich import progress as rich
    from rich.console import Console

    columns = (rich.BarColumn(), rich.MofNCompleteColumn(), rich.TimeElapsedColumn(), rich.TimeRemainingColumn())
    progress = rich.Progress(rich.TextColumn("{task.description}"), *columns, console=Console(stderr=True))

    def tell(done: int, total: int) -> None:
        if not progress.task_ids:
            progress.add_task(what)
            progress.start()
        progress.update(progress.task_ids[0], completed=done, total=total)

    try:
        yield tell
    finally:
        progress.stop()


@contextmanager
def paced_bar(what: str) -> Iterator[Callable[[int, int, float | None], None]]:
    """A progress bar whose teller knows the seconds left; they count down until it is told again."""
    from rich import progress as rich
    from rich.console import Console

    columns = (rich.BarColumn(), rich.MofNCompleteColumn(), rich.TimeElapsedColumn(), time_left())
    progress = rich.Progress(rich.TextColumn("{task.description}"), *columns, console=Console(stderr=True))

    def tell(done: int, total: int, seconds_left: float | None) -> None:
        if not progress.task_ids:
            progress.add_task(what, left=None, told=0.0)
            progress.start()
        told = time.monotonic()
        progress.update(progress.task_ids[0], completed=done, total=total, left=seconds_left, told=told)

    try:
        yield tell
    finally:
        progress.stop()


def time_left() -> ProgressColumn:
    """A column of a bar: the seconds left as its task was told last, less those since."""
    from rich import progress as rich
    from rich.text import Text

    class TimeLeft(rich.ProgressColumn):
        """Renders the task's fields ``left`` and ``told``."""

        def render(self, task: rich.Task) -> Text:
            left = task.fields["left"]
            if left is None:
                return Text("", style="progress.remaining")
            seconds = max(0, round(left - (time.monotonic() - task.fields["told"])))
            return Text(f"{timedelta(seconds=seconds)} left", style="progress.remaining")

    return TimeLeft()


@contextmanager
def training_line() -> Iterator[Callable[[Progress], None]]:
    """A live line of a training run; the scores of rollouts stay on the screen."""
    from rich import progress as rich
    from rich.console import Console

    columns = (rich.BarColumn(), rich.MofNCompleteColumn(), rich.TimeElapsedColumn(), time_left())
    line = rich.Progress(rich.TextColumn("loss {task.fields[loss]:.4f}"), *columns, console=Console(stderr=True))

    def tell(now: Progress) -> None:
        if not line.task_ids:
            line.add_task("", loss=now.loss, left=None, told=0.0)
            line.start()
        told = time.monotonic()
        fields = {"loss": now.loss, "left": now.seconds_left, "told": told}
        line.update(line.task_ids[0], completed=now.step, total=now.steps, **fields)
        if now.scores is not None:
            line.console.print(f"step {now.step}: {now.scores}", highlight=False)

    try:
        yield tell
    finally:
        line.stop()


@contextmanager
def fitting_line() -> Iterator[Callable[[FitProgress], None]]:
    """A live line of a fit: its loss, and the error that was measured last; what was measured stays on the screen."""
    from rich import progress as rich
    from rich.console import Console

    columns = (rich.BarColumn(), rich.MofNCompleteColumn(), rich.TimeElapsedColumn(), time_left())
    text = rich.TextColumn("loss {task.fields[loss]:.4g}, error {task.fields[error]:.3g}")
    line = rich.Progress(text, *columns, console=Console(stderr=True))

    def tell(now: FitProgress) -> None:
        if not line.task_ids:
            line.add_task("", loss=now.loss, error=now.error, left=None, told=0.0)
            line.start()
        told = time.monotonic()
        fields = {"loss": now.loss, "error": now.error, "left": now.seconds_left, "told": told}
        line.update(line.task_ids[0], completed=now.step, total=now.steps, **fields)
        if now.measured:
            line.console.print(f"step {now.step}: loss {now.loss:.4g}, error {now.error:.3g}", highlight=False)

    try:
        yield tell
    finally:
        line.stop()


@contextmanager
def design_line(what: str) -> Iterator[Callable[[DesignProgress], None]]:
    """A live line of a design run: iteration, reward, parameters, time left."""
    from rich import progress as rich
    from rich.console import Console

    columns = (rich.BarColumn(), rich.MofNCompleteColumn(), rich.TimeElapsedColumn(), time_left())
    text = rich.TextColumn("{task.description} reward {task.fields[reward]:.4f}, {task.fields[values]}")
    line = rich.Progress(text, *columns, console=Console(stderr=True))

    def tell(now: DesignProgress) -> None:
        fields = {"reward": now.reward, "values": now.values, "left": now.seconds_left, "told": time.monotonic()}
        if not line.task_ids:
            line.add_task(what, **fields)
            line.start()
        line.update(line.task_ids[0], completed=now.iteration, total=now.iterations, **fields)

    try:
        yield tell
    finally:
        line.stop()
