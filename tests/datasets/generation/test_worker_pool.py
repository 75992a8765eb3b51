import logging
import os
import socket
import time

import pytest

from surfsup.datasets.folder import lock_folder
from surfsup.datasets.generation import worker_pool
from surfsup.datasets.generation.worker_pool import missing_requirement, open_worker_pool, until_canceled
from surfsup.errors import InputError
from surfsup.splishsplash.solver import SolverError
from tests.datasets.conftest import needs_solver


def fail(kind: type[Exception]) -> None:
    raise kind("it went wrong")


def test_few_workers_are_threads_of_this_process():
    with open_worker_pool(workers=3) as pool:
        assert pool.slots == 3
        assert {done.result() for done in pool.as_completed([pool.submit(os.getpid)])} == {os.getpid()}


def test_many_workers_are_distributed_over_processes():
    with open_worker_pool(workers=9) as pool:
        assert pool.slots == 9
        pids = {done.result() for done in pool.as_completed([pool.submit(os.getpid) for _ in range(30)])}
    assert len(pids) > 1
    assert os.getpid() not in pids


@pytest.mark.parametrize("kind", [InputError, SolverError])
def test_a_jobs_error_is_raised_and_other_jobs_finish(kind):
    with open_worker_pool(workers=2) as pool:
        jobs = [pool.submit(fail, kind), pool.submit(os.getpid)]
        assert set(pool.as_completed(jobs)) == set(jobs)
        with pytest.raises(kind, match="it went wrong"):
            jobs[0].result()
        assert jobs[1].result() == os.getpid()


@needs_solver
def test_a_worker_must_have_the_folder_the_version_and_the_solver(tmp_path):
    with lock_folder(tmp_path) as token:
        assert missing_requirement(tmp_path, token, worker_pool.__version__) is None
        assert "does not see" in missing_requirement(tmp_path / "elsewhere", token, worker_pool.__version__)
        assert "does not see" in missing_requirement(tmp_path, "another run's", worker_pool.__version__)
        assert "but needs 99.0" in missing_requirement(tmp_path, token, "99.0")
        with open_worker_pool(workers=1) as pool:
            pool.check_workers(tmp_path, token)
            with pytest.raises(InputError, match="does not see"):
                pool.check_workers(tmp_path, "another run's")


def test_an_address_without_a_scheduler_is_an_error_within_seconds(monkeypatch):
    monkeypatch.setattr(worker_pool, "CONNECT_TIMEOUT", 0.3)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with (
            pytest.raises(InputError, match=f"no dask scheduler answers at {address}"),
            open_worker_pool(scheduler=address),
        ):
            pass


def test_a_scheduler_without_workers_is_an_error_within_seconds(monkeypatch):
    from distributed import LocalCluster

    monkeypatch.setattr(worker_pool, "WORKER_TIMEOUT", 0.3)
    with (
        LocalCluster(
            n_workers=0, processes=True, dashboard_address="127.0.0.1:0", silence_logs=worker_pool.SILENT
        ) as cluster,
        pytest.raises(InputError, match="has no workers; start some: dask worker tcp://"),
        open_worker_pool(scheduler=cluster.scheduler_address),
    ):
        pass


def test_dasks_log_level_is_restored():
    logger = logging.getLogger("distributed")
    before = logger.level
    with open_worker_pool(workers=1):
        assert not logger.isEnabledFor(logging.CRITICAL)
    assert logger.level == before


def endless_frames(ended):
    try:
        while True:
            time.sleep(0.01)
            yield "frame"
    finally:
        ended.touch()


def iterate(begun, ended):
    for _ in until_canceled(endless_frames(ended)):
        begun.touch()


def test_a_simulation_stops_when_the_pool_closes(tmp_path):
    begun, ended = tmp_path / "begun", tmp_path / "ended"
    with open_worker_pool(workers=1) as pool:
        job = pool.submit(iterate, begun, ended)
        while not begun.exists():
            time.sleep(0.01)
        assert not job.done()
        assert not ended.exists()
    assert ended.exists()
