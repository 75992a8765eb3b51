"""The progress bar of every verb that takes long."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich import progress as rich

    from surfsup.optim.loop import Progress


class ProgressBar:
    """A bar on standard error that appears with its first update; see :func:`progress_bar`.

    Attributes:
        description: text before the bar.
    """

    def __init__(self, description: str, bars: rich.Progress) -> None:
        self.description = description
        self._bars = bars

    def __call__(self, done: int, total: int, seconds_left: float | None = None) -> None:
        """Show that ``done`` of ``total`` are done. Without ``seconds_left`` the bar estimates the remaining time."""
        if not self._bars.task_ids:
            self._bars.add_task(self.description, seconds_left=None, updated=0.0)
            self._bars.start()
        self._bars.update(
            self._bars.task_ids[0],
            description=self.description,
            completed=done,
            total=total,
            seconds_left=seconds_left,
            updated=time.monotonic(),
        )

    def report(self, progress: Progress[Any]) -> None:
        """Show the state of an optimization; the results of validations stay on the screen above the bar."""
        self.description = f"loss {progress.loss:.4g}"
        self(progress.step, progress.steps, progress.seconds_left)
        if progress.validation is not None:
            line = f"step {progress.step}: {progress.validation}"
            self._bars.console.print(line, highlight=False, markup=False)


@contextmanager
def progress_bar(description: str) -> Iterator[ProgressBar]:
    """Show a progress bar until the block ends."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.description}", markup=False)
    columns = (text, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), time_left_column())
    progress = Progress(*columns, console=Console(stderr=True))
    try:
        yield ProgressBar(description, progress)
    finally:
        if progress.task_ids:
            progress.stop()


def time_left_column() -> rich.ProgressColumn:
    """A column with the remaining time, which counts down between updates."""
    from rich.progress import Task, TimeRemainingColumn
    from rich.text import Text

    class TimeLeft(TimeRemainingColumn):
        """The task's own ``seconds_left``, or rich's estimate from the speed so far."""

        def render(self, task: Task) -> Text:
            if task.fields["seconds_left"] is None:
                return super().render(task)
            seconds = task.fields["seconds_left"] - (time.monotonic() - task.fields["updated"])
            return Text(f"{timedelta(seconds=max(0, round(seconds)))}", style="progress.remaining")

    return TimeLeft()
