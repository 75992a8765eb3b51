"""The progress of every verb that takes long: a bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich import progress as rich

    from surfsup.optim.loop import Progress
    from surfsup.optim.stopping import Stop

LINE_EVERY = 5.0  # seconds between two plain lines


class ProgressDisplay(ABC):
    """Shows on standard error how far a task is; see :func:`progress_bar`.

    Attributes:
        description: text before the numbers.
    """

    def __init__(self, description: str, stop: Stop | None = None) -> None:
        self.description, self._stop = description, stop

    @abstractmethod
    def __call__(self, done: int, total: int, seconds_left: float | None = None) -> None:
        """Show that ``done`` of ``total`` are done. ``seconds_left`` is estimated from the speed so far if None."""

    @abstractmethod
    def print(self, line: str) -> None:
        """Print a line that stays."""

    @abstractmethod
    def close(self) -> None:
        """End the display; the last state stays on the screen."""

    def report(self, progress: Progress[Any]) -> None:
        """Show the state of an optimization; the results of validations stay on the screen."""
        self.description = f"loss {progress.loss:.4g}"
        limit = math.inf if self._stop is None else self._stop.seconds_left
        self(progress.step, progress.steps, min(progress.seconds_left, limit))
        if progress.validation is not None:
            self.print(f"step {progress.step}: {progress.validation}")


class ProgressBar(ProgressDisplay):
    """A bar on a terminal that appears with its first update."""

    def __init__(self, description: str, stop: Stop | None = None) -> None:
        super().__init__(description, stop)
        self._bars = rich_bars()

    def __call__(self, done: int, total: int, seconds_left: float | None = None) -> None:
        """Move the bar."""
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

    def print(self, line: str) -> None:
        """Print a line above the bar."""
        self._bars.console.print(line, highlight=False, markup=False)

    def close(self) -> None:
        """Leave the bar as it is."""
        if self._bars.task_ids:
            self._bars.stop()


class ProgressLines(ProgressDisplay):
    """A plain line every few seconds, and one at the end, where standard error is a file or a pipe."""

    def __init__(self, description: str, stop: Stop | None = None) -> None:
        super().__init__(description, stop)
        self._started = self._printed = time.monotonic()
        self._first: tuple[float, int] | None = None
        self._unprinted = ""

    def __call__(self, done: int, total: int, seconds_left: float | None = None) -> None:
        """Print the state if the last line is some seconds old."""
        now = time.monotonic()
        elapsed = now - self._started
        # The first step often includes what is done once, so the speed is that of the steps after it.
        since, first = self._first = self._first or (now, done)
        if seconds_left is None and done > first:
            seconds_left = (now - since) / (done - first) * (total - done)
        self._unprinted = f"{self.description}: {done}/{total}, {rounded(elapsed)}"
        if seconds_left is not None and done < total:
            self._unprinted += f", {rounded(seconds_left)} left"
        if now - self._printed >= LINE_EVERY:
            self._print_state(now)

    def print(self, line: str) -> None:
        """Print a line."""
        sys.stderr.write(f"{line}\n")
        sys.stderr.flush()

    def close(self) -> None:
        """Print the last state if no line has shown it."""
        if self._unprinted:
            self._print_state(time.monotonic())

    def _print_state(self, now: float) -> None:
        self.print(self._unprinted)
        self._unprinted, self._printed = "", now


@contextmanager
def progress_bar(description: str, stop: Stop | None = None) -> Iterator[ProgressDisplay]:
    """Show the progress of a task until the block ends, on a terminal as a bar.

    Args:
        description: text before the numbers.
        stop: what ends an optimization early, so that no more time is shown as left than its limit.
    """
    display = (ProgressBar if sys.stderr.isatty() else ProgressLines)(description, stop)
    try:
        yield display
    finally:
        display.close()


def rounded(seconds: float) -> timedelta:
    """A duration in whole seconds, not below zero."""
    return timedelta(seconds=max(0, round(seconds)))


def rich_bars() -> rich.Progress:
    """An empty set of bars on standard error."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    text = TextColumn("{task.description}", markup=False)
    columns = (text, BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), time_left_column())
    return Progress(*columns, console=Console(stderr=True))


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
            return Text(f"{rounded(seconds)}", style="progress.remaining")

    return TimeLeft()
