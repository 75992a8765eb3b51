"""What a terminal shows while something takes long; on standard error, and only once something is done."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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
def training_line() -> Iterator[Callable[[Progress], None]]:
    """A live line of a training run; the scores of rollouts stay on the screen."""
    from rich import progress as rich
    from rich.console import Console

    columns = (rich.BarColumn(), rich.MofNCompleteColumn(), rich.TimeElapsedColumn(), rich.TimeRemainingColumn())
    line = rich.Progress(rich.TextColumn("loss {task.fields[loss]:.4f}"), *columns, console=Console(stderr=True))

    def tell(now: Progress) -> None:
        if not line.task_ids:
            line.add_task("", loss=now.loss)
            line.start()
        line.update(line.task_ids[0], completed=now.step, total=now.steps, loss=now.loss)
        if now.scores is not None:
            line.console.print(f"step {now.step}: {now.scores}", highlight=False)

    try:
        yield tell
    finally:
        line.stop()
