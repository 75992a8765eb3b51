"""surfsup in a child of this process, which has already imported the libraries, so that a start takes no second."""

from __future__ import annotations

import os
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

LIMIT = 60.0  # seconds after which a run counts as a hang
POLL = 0.005


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes:
        status: exit status; minus the number of the signal that ended it.
        seconds: it took.
        printed, errors: on standard output and standard error.
        timed_out: whether it was still running after its limit.
    """

    status: int
    seconds: float
    printed: str
    errors: str
    timed_out: bool = False


class Run:
    """A run of `surfsup` that has begun."""

    def __init__(
        self, arguments: Sequence[object], folder: Path, before: Callable[[], None] | None = None, mask: int = 0o22
    ) -> None:
        """Begin `surfsup ARGUMENTS` in ``folder``; ``before`` is called in the child first."""
        self._began = time.monotonic()
        self._status: int | None = None
        self._files = [tempfile.TemporaryFile() for _ in range(2)]  # noqa: SIM115  read when the run has ended
        sys.stdout.flush()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid == 0:
            self._be_surfsup([str(argument) for argument in arguments], folder, before, mask)

    def _be_surfsup(self, arguments: list[str], folder: Path, before: Callable[[], None] | None, mask: int) -> None:
        status = 70
        try:
            os.setsid()
            os.umask(mask)
            os.chdir(folder)
            nothing = os.open(os.devnull, os.O_RDONLY)
            for source, target in ((nothing, 0), (self._files[0].fileno(), 1), (self._files[1].fileno(), 2)):
                os.dup2(source, target)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            sys.argv = ["surfsup", *arguments]
            if before is not None:
                before()
            from surfsup.cli.program import main

            main()
            status = 0
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
        except BaseException:
            traceback.print_exc()
            status = 1
        finally:
            try:
                sys.stdout.flush()
                sys.stderr.flush()
            except OSError:
                status = status or 1
            os._exit(status)

    def poll_only(self) -> int | None:
        """The status if it has ended; it can still be waited for."""
        if self._status is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self._status = os.waitstatus_to_exitcode(status) if pid else None
        return self._status

    def send(self, number: int) -> None:
        """Send a signal."""
        os.kill(self.pid, number)

    def wait(self, limit: float = LIMIT) -> Outcome:
        """Wait for the end, at most ``limit`` seconds; then it is killed."""
        timed_out = False
        while (status := self.poll_only()) is None:
            if time.monotonic() - self._began > limit:
                timed_out = True
                os.killpg(self.pid, signal.SIGKILL)
                _, code = os.waitpid(self.pid, 0)
                status = os.waitstatus_to_exitcode(code)
                break
            time.sleep(POLL)
        texts = []
        for file in self._files:
            file.seek(0)
            texts.append(file.read().decode(errors="replace"))
            file.close()
        return Outcome(status, time.monotonic() - self._began, *texts, timed_out)


def surfsup(
    arguments: Sequence[object],
    folder: Path,
    before: Callable[[], None] | None = None,
    limit: float = LIMIT,
) -> Outcome:
    """The outcome of `surfsup ARGUMENTS` in ``folder``."""
    return Run(arguments, folder, before).wait(limit)


def call(function: Callable[[], str], limit: float = LIMIT) -> str:
    """The text that ``function`` returns in a child; a crash or a hang there is a text, too."""
    answer = tempfile.TemporaryFile()  # noqa: SIM115
    pid = os.fork()
    if pid == 0:
        try:
            text = function()
        except BaseException as error:
            text = f"the check failed: {type(error).__name__}: {error}"
        answer.write(text.encode())
        answer.flush()
        os._exit(0)
    ends = time.monotonic() + limit
    while os.waitpid(pid, os.WNOHANG) == (0, 0):
        if time.monotonic() > ends:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            return "the check hung"
        time.sleep(POLL)
    answer.seek(0)
    return answer.read().decode()
