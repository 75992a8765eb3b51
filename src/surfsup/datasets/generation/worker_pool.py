"""Many simulations side by side: on this machine's cores, or on the workers of a dask scheduler."""

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
from surfsup.datasets.folder import lock_token
from surfsup.errors import InputError, SimulationError, single_line
from surfsup.splishsplash import solver

if TYPE_CHECKING:
    from distributed import Client

DEFAULT_WORKERS = 2
CONNECT_TIMEOUT = 4.0  # seconds until a scheduler must answer
WORKER_TIMEOUT = 5.0  # seconds until a scheduler must have a worker
POLL_INTERVAL = 1.0  # seconds between checks for lost workers
MAX_THREADS = 8  # per process
SILENT = logging.CRITICAL + 1
LOGGERS = ("distributed", "tornado", "asyncio")
REFERENCE = (solver.check_installed,)  # what most work here needs

T = TypeVar("T")


class LostWorkerWarning(UserWarning):
    """A worker is gone. Another one repeats its work."""


class WorkerPool:
    """Workers that each run one simulation per thread.

    Attributes:
        slots: number of simulations that run side by side.
    """

    def __init__(self, client: Client, scheduler: str | None) -> None:
        """Use ``client``, connected to the user's ``scheduler``, or to a cluster of this process if it is None."""
        self._client, self._scheduler = client, scheduler
        self._workers = self._threads()
        self.slots = sum(self._workers.values())

    def _threads(self) -> dict[str, int]:
        """Number of threads of each worker."""
        return dict(self._client.nthreads())

    def check_workers(
        self, folder: Path | None, token: str = "", requirements: Sequence[Callable[[], None]] = REFERENCE
    ) -> None:
        """Check that every worker can run simulations.

        Args:
            folder: that all workers must share under this path; None if they need none.
            token: in the folder's lock file.
            requirements: functions that raise InputError on a worker that lacks something.

        Raises:
            InputError: a worker lacks surfsup, this version of it, a requirement or the folder.
        """
        found = self._client.run(
            missing_requirement, folder, token, __version__, tuple(requirements), on_error="return"
        )
        for worker, problem in found.items():
            if isinstance(problem, BaseException):
                problem = f"cannot run surfsup {__version__} ({single_line(problem)})"
            if problem is not None:
                raise InputError(problem if self._scheduler is None else f"worker {worker}: {problem}")

    def submit(self, job: Callable[..., T], *arguments: object) -> Future[T]:
        """Run ``job(*arguments)`` on a worker.

        The future raises what the job raises, or SimulationError if the scheduler was lost or the job crashed every
        worker that it ran on.
        """
        # The key is unique: a killed run may have left results of the same job at the scheduler.
        key = f"{job.__name__}-{uuid.uuid4().hex}"
        remote = self._client.submit(run_single_threaded, job, *arguments, key=key, pure=False)
        future: Future[T] = Future()

        def settle(done: Any) -> None:
            # This runs in dask's thread, not in the caller's: if a result is lost with its worker before it arrives,
            # it is computed again, which takes as long as there are no workers.
            try:
                future.set_result(self._result(done))
            except BaseException as error:
                future.set_exception(error)

        remote.add_done_callback(settle)
        return future

    def as_completed(self, futures: Sequence[Future[T]]) -> Iterator[Future[T]]:
        """Yield each of ``futures`` when it is done.

        Raises:
            SimulationError: the scheduler was lost.
        """
        done: queue.SimpleQueue[Future[T]] = queue.SimpleQueue()
        for future in futures:
            future.add_done_callback(done.put)
        for _ in futures:
            yield self.wait_for(done)

    def wait_for(self, done: queue.SimpleQueue[T]) -> T:
        """Wait for the next item of ``done``, and warn of lost workers meanwhile.

        Raises:
            SimulationError: the scheduler was lost.
        """
        while True:
            self.check_losses()
            with suppress(queue.Empty):
                return done.get(timeout=POLL_INTERVAL)

    def _result(self, remote: Any) -> Any:
        from distributed.scheduler import KilledWorker

        try:
            return remote.result()
        except CancelledError:
            raise self._lost_scheduler() from None
        except KilledWorker as error:
            raise SimulationError(
                f"{error.allowed_failures + 1} workers were lost one after the other at the same scene; have they "
                "enough memory?"
            ) from None

    def check_losses(self) -> None:
        """Warn of each worker that was lost.

        Raises:
            SimulationError: the scheduler was lost.
        """
        if self._scheduler is None:
            return
        try:
            present = self._threads()
        except Exception:
            raise self._lost_scheduler() from None
        lost = self._workers.keys() - present.keys()
        left = f"{len(present)} left" if present else "none left, waiting for new ones"
        for worker in sorted(lost):
            warnings.warn(LostWorkerWarning(f"worker {worker} was lost, others do its work; {left}"), stacklevel=2)
        self._workers, self.slots = present, sum(present.values())

    def _lost_scheduler(self) -> SimulationError:
        return SimulationError(
            f"the scheduler at {self._scheduler} was lost; finished scenes are kept, run the same command to resume"
        )


def run_single_threaded(job: Callable[..., T], *arguments: object) -> T:
    """Run ``job(*arguments)`` with one thread of torch.

    Many jobs run side by side. The threads of a parallel loop spin for a while after their part, which took more CPU
    time than the work itself.
    """
    import torch

    torch.set_num_threads(1)  # of this thread and of threads that start later
    return job(*arguments)


class CanceledError(Exception):
    """The simulation's result is no longer needed."""


def until_canceled(frames: Generator[T, None, None]) -> Iterator[T]:
    """Yield ``frames`` until dask cancels the simulation; dask cannot stop a running job by itself.

    Raises:
        CanceledError: the worker is closing, or the client has gone.
    """
    from distributed import get_worker

    worker = get_worker()
    key = worker.get_current_task()
    with closing(frames):
        for frame in frames:
            task = worker.state.tasks.get(key)
            # dask spells it "cancelled".
            if worker.status.name in ("closing", "closed") or task is None or task.state == "cancelled":
                raise CanceledError
            yield frame


def missing_requirement(
    folder: Path | None, token: str, version: str, requirements: Sequence[Callable[[], None]] = REFERENCE
) -> str | None:
    """Why this worker cannot run simulations; None if it can."""
    if version != __version__:
        return f"has surfsup {__version__}, but needs {version}"
    if folder is not None and lock_token(folder) != token:
        return f"does not see {folder}; it must be a folder that all machines share under one path"
    try:
        for check in requirements:
            check()
    except InputError as error:
        return str(error)
    return None


@contextmanager
def open_worker_pool(workers: int | None = None, scheduler: str | None = None) -> Iterator[WorkerPool]:
    """A worker pool for the duration of the context.

    Args:
        workers: simulations side by side on this machine, each on one core; 2 by default.
        scheduler: address of a running dask scheduler to use instead.

    Raises:
        InputError: both are given, there are no workers, the scheduler does not answer, or dask is not installed.
    """
    if workers is not None and scheduler is not None:
        raise InputError("--workers are of this machine, --scheduler has its own: give only one of them")
    if workers is not None and workers < 1:
        raise InputError(f"the number of workers is {workers}, but must be at least 1")
    try:
        from distributed import Client
    except ModuleNotFoundError:
        raise InputError("dask, which spreads the work, is not installed: pip install 'surfsup[batches]'") from None
    with silenced_logs(), cluster_address(workers or DEFAULT_WORKERS, scheduler) as address:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of version differences; WorkerPool.check_workers checks what matters
            client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
        try:
            if scheduler is not None:
                wait_for_worker(client, scheduler)
            yield WorkerPool(client, scheduler)
        finally:
            client.close(timeout=CONNECT_TIMEOUT)


@contextmanager
def cluster_address(workers: int, scheduler: str | None) -> Iterator[Any]:
    """The address for a client: the user's scheduler, or a new cluster of this process.

    Raises:
        InputError: no scheduler answers.
    """
    if scheduler is not None:
        check_scheduler(scheduler)
        yield scheduler
        return
    from distributed import LocalCluster

    # Each simulation is a child process, so threads suffice here: they share memory and start at once. Each takes a
    # twentieth of a core; many are distributed over several processes. dask cannot leave out its status pages; this
    # machine alone can open them.
    threads = max(count for count in range(1, MAX_THREADS + 1) if workers % count == 0)
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
    """Check that a dask scheduler answers at ``address``.

    Raises:
        InputError: nothing answers, or something else does.
    """
    from distributed.core import rpc

    async def identity() -> dict[str, Any]:
        connection = rpc(address, timeout=CONNECT_TIMEOUT)
        try:
            return await connection.identity()
        finally:
            await connection.close_rpc()

    async def identity_in_time() -> dict[str, Any]:
        return await asyncio.wait_for(identity(), CONNECT_TIMEOUT + 1)

    try:
        kind = asyncio.run(identity_in_time()).get("type")
    except (OSError, TimeoutError):
        raise InputError(f"no dask scheduler answers at {address}; start one with 'dask scheduler'") from None
    except Exception as error:
        raise InputError(
            f"--scheduler {address}: is not the address of a dask scheduler, such as tcp://127.0.0.1:8786 ({error})"
        ) from None
    if kind != "Scheduler":
        raise InputError(f"--scheduler {address}: is the address of a dask {kind}, not of a scheduler")


def wait_for_worker(client: Client, scheduler: str) -> None:
    """Wait until the scheduler has a worker.

    Raises:
        InputError: none appears in time.
    """
    try:
        client.wait_for_workers(1, timeout=WORKER_TIMEOUT)
    except TimeoutError:
        raise InputError(f"the scheduler at {scheduler} has no workers; start some: dask worker {scheduler}") from None


@contextmanager
def silenced_logs() -> Iterator[None]:
    """Silence dask's log lines; our own messages have what a user needs to know."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in LOGGERS]
    loggers = [logging.getLogger(name) for name in {*names, *LOGGERS}]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(SILENT)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
