"""Many simulations side by side: on this machine's cores, or by the workers of a dask scheduler."""

from __future__ import annotations

import asyncio
import logging
import queue
import uuid
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from surfsup import __version__
from surfsup.datasets.folder import token_of
from surfsup.errors import InputError, SimulationError
from surfsup.splishsplash import solver

if TYPE_CHECKING:
    from distributed import Client

WORKERS = 2  # by default
PATIENCE = 4.0  # seconds that a scheduler may take to answer
WORKER_PATIENCE = 5.0  # and its workers to appear
LOOK_EVERY = 1.0  # seconds between looks for workers that were lost
MOST_THREADS = 8  # of a process
SILENT = logging.CRITICAL + 1
LOUD_LIBRARIES = ("distributed", "tornado", "asyncio")

T = TypeVar("T")


class LostWorkerWarning(UserWarning):
    """A worker is gone; what it was doing is done by another."""


class Crew:
    """Workers, each of which runs one simulation a thread.

    Attributes:
        slots: simulations that run side by side.
    """

    def __init__(self, client: Client, scheduler: str | None) -> None:
        """Take ``client``, connected to the ``scheduler`` of the user, or to this process's own for None."""
        self._client, self._scheduler = client, scheduler
        self._workers = self._present()
        self.slots = sum(self._workers.values())

    def _present(self) -> dict[str, int]:
        """Threads of each worker."""
        return dict(self._client.nthreads())

    def require(self, folder: Path | None, token: str = "") -> None:
        """Check that every worker can do its work.

        Args:
            folder: that all must see under this path; None where they need none.
            token: that stands in the folder's lock file.

        Raises:
            InputError: one lacks surfsup, this version of it, the solver or the folder.
        """
        found = self._client.run(what_is_missing, folder, token, __version__, on_error="return")
        for worker, complaint in found.items():
            if isinstance(complaint, BaseException):
                complaint = f"cannot run surfsup {__version__} ({' '.join(str(complaint).split())})"
            if complaint is not None:
                raise InputError(complaint if self._scheduler is None else f"worker {worker}: {complaint}")

    def submit(self, job: Callable[..., T], *arguments: object) -> Future[T]:
        """Have ``job(*arguments)`` done by some worker.

        Besides what the job raises, the future raises SimulationError when the scheduler was lost, or the job took down
        every worker that it was given to.
        """
        # A key of its own for each: what a run that was killed left with the scheduler is not taken for ours.
        key = f"{job.__name__}-{uuid.uuid4().hex}"
        remote = self._client.submit(on_one_core, job, *arguments, key=key, pure=False)
        promise: Future[T] = Future()

        def settle(done: Any) -> None:
            # Not by whoever waits for it: a result may be lost with its worker before it is here, and is then made
            # once more, which takes as long as there are no workers.
            try:
                promise.set_result(self._outcome(done))
            except BaseException as error:
                promise.set_exception(error)

        remote.add_done_callback(settle)
        return promise

    def finished(self, waiting: Sequence[Future[T]]) -> Iterator[Future[T]]:
        """Yield each of ``waiting`` as it gets done, in whatever order.

        Raises:
            SimulationError: the scheduler was lost.
        """
        done: queue.SimpleQueue[Future[T]] = queue.SimpleQueue()
        for future in waiting:
            future.add_done_callback(done.put)
        for _ in waiting:
            yield self.next_of(done)

    def next_of(self, done: queue.SimpleQueue[T]) -> T:
        """What is put into ``done`` next; meanwhile workers that get lost are told of.

        Raises:
            SimulationError: the scheduler was lost.
        """
        while True:
            self.look_for_losses()
            with suppress(queue.Empty):
                return done.get(timeout=LOOK_EVERY)

    def _outcome(self, remote: Any) -> Any:
        from distributed.scheduler import KilledWorker

        try:
            return remote.result()
        except CancelledError:
            raise self._lost() from None
        except KilledWorker as error:
            raise SimulationError(
                f"{error.allowed_failures + 1} workers were lost one after the other at the same scene; have they "
                "enough memory?"
            ) from None

    def look_for_losses(self) -> None:
        """Warn of each worker that has gone.

        Raises:
            SimulationError: the scheduler has gone too.
        """
        if self._scheduler is None:
            return
        try:
            present = self._present()
        except Exception:
            raise self._lost() from None
        lost = self._workers.keys() - present.keys()
        left = f"{len(present)} left" if present else "none left, waiting for new ones"
        for worker in sorted(lost):
            warnings.warn(LostWorkerWarning(f"worker {worker} was lost, others do its work; {left}"), stacklevel=2)
        self._workers, self.slots = present, sum(present.values())

    def _lost(self) -> SimulationError:
        return SimulationError(
            f"the scheduler at {self._scheduler} was lost; what was finished is kept, the same command goes on"
        )


def on_one_core(job: Callable[..., T], *arguments: object) -> T:
    """Do ``job(*arguments)`` in this thread without help from others.

    Many jobs run side by side. The other threads of a parallel loop of torch, when they have done their part, spin
    for a while in wait of the next, and took more of the cores that way than all the work had in it.
    """
    import torch

    torch.set_num_threads(1)  # of this thread, and of those that begin after it
    return job(*arguments)


class AbandonedError(Exception):
    """Nobody waits for this simulation any more."""


def while_wanted(frames: Generator[T, None, None]) -> Iterator[T]:
    """The ``frames`` of a simulation, which dask itself could not stop once it has begun.

    Raises:
        AbandonedError: the worker is closing, or whoever asked for the simulation has gone.
    """
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()
    with closing(frames) as going_on:
        for frame in going_on:
            task = worker.state.tasks.get(key)
            if worker.status.name in ("closing", "closed") or task is None or task.state == "canceled":
                raise AbandonedError
            yield frame


def what_is_missing(folder: Path | None, token: str, version: str) -> str | None:
    """Asked of a worker: why it cannot do its work, None where it can."""
    if version != __version__:
        return f"has surfsup {__version__}, but {version} is wanted"
    if folder is not None and token_of(folder) != token:
        return f"does not see {folder}; it must be a folder that all machines share under one path"
    try:
        solver.require()
    except InputError as error:
        return str(error)
    return None


@contextmanager
def crew(workers: int | None = None, scheduler: str | None = None) -> Iterator[Crew]:
    """Workers for as long as they are needed.

    Args:
        workers: simulations side by side on this machine, each on one core; 2 by default.
        scheduler: address of a running dask scheduler, whose workers do it instead.

    Raises:
        InputError: both are given, there are none, nobody answers there, or dask is not installed.
    """
    if workers is not None and scheduler is not None:
        raise InputError("--workers are of this machine, --scheduler has its own: give only one of them")
    if workers is not None and workers < 1:
        raise InputError(f"asked for {workers} workers; there must be at least 1")
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise InputError("dask, which spreads the work, is not installed: pip install 'surfsup[reference]'") from None
    with quiet(), connected(workers or WORKERS, scheduler) as address:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of versions that differ; what matters is checked by Crew.require
            client = Client(address, timeout=PATIENCE, set_as_default=False)
        try:
            if scheduler is not None:
                wait_for_a_worker(client, scheduler)
            yield Crew(client, scheduler)
        finally:
            client.close(timeout=PATIENCE)


@contextmanager
def connected(workers: int, scheduler: str | None) -> Iterator[Any]:
    """What a client can connect to: the user's scheduler, or a cluster of this process.

    Raises:
        InputError: no scheduler answers.
    """
    if scheduler is not None:
        check_scheduler(scheduler)
        yield scheduler
        return
    from distributed import LocalCluster

    # Every simulation is a process of its own, so threads will do here: joined through memory, and there at once. What
    # they do takes a twentieth of a core each; for many it is shared out to several processes. The status pages, which
    # dask cannot leave out, are served to this machine only.
    threads = max(count for count in range(1, MOST_THREADS + 1) if workers % count == 0)
    with LocalCluster(
        n_workers=workers // threads,
        threads_per_worker=threads,
        processes=threads < workers,
        memory_limit=0,
        dashboard_address="127.0.0.1:0",
        worker_dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
        silence_logs=SILENT,
    ) as cluster:
        yield cluster


def check_scheduler(address: str) -> None:
    """Ask the scheduler at ``address`` for its name.

    Raises:
        InputError: it does not answer, or something else does.
    """
    from distributed.core import rpc

    async def ask() -> dict[str, Any]:
        connection = rpc(address, timeout=PATIENCE)
        try:
            return await connection.identity()
        finally:
            await connection.close_rpc()

    async def ask_in_time() -> dict[str, Any]:
        return await asyncio.wait_for(ask(), PATIENCE + 1)

    try:
        kind = asyncio.run(ask_in_time()).get("type")
    except (OSError, TimeoutError):
        raise InputError(f"no dask scheduler answers at {address}; start one with 'dask scheduler'") from None
    except Exception as error:
        raise InputError(
            f"--scheduler {address}: is not the address of a dask scheduler, such as tcp://127.0.0.1:8786 ({error})"
        ) from None
    if kind != "Scheduler":
        raise InputError(f"--scheduler {address}: is the address of a dask {kind}, not of a scheduler")


def wait_for_a_worker(client: Client, scheduler: str) -> None:
    """Wait until the scheduler has a worker.

    Raises:
        InputError: none appears in time.
    """
    try:
        client.wait_for_workers(1, timeout=WORKER_PATIENCE)
    except TimeoutError:
        raise InputError(f"the scheduler at {scheduler} has no workers; start some: dask worker {scheduler}") from None


@contextmanager
def quiet() -> Iterator[None]:
    """Keep the log lines of dask to itself: what a user needs to know is told in our own words."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in LOUD_LIBRARIES]
    loggers = [logging.getLogger(name) for name in {*names, *LOUD_LIBRARIES}]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(SILENT)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
