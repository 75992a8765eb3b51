import logging
import os
import socket
import time

import pytest

from surfsup.datasets.folder import locked
from surfsup.datasets.generation import worker_pool
from surfsup.datasets.generation.worker_pool import crew, what_is_missing, while_wanted
from surfsup.errors import InputError
from surfsup.splishsplash.solver import SolverError
from tests.datasets.conftest import needs_solver


def fail(kind: type[Exception]) -> None:
    raise kind("it went wrong")


def test_a_few_workers_are_threads_of_this_process():
    with crew(workers=3) as doers:
        assert doers.slots == 3
        assert {done.result() for done in doers.finished([doers.submit(os.getpid)])} == {os.getpid()}


def test_many_workers_are_shared_out_to_processes():
    with crew(workers=9) as doers:
        assert doers.slots == 9
        pids = {done.result() for done in doers.finished([doers.submit(os.getpid) for _ in range(30)])}
    assert len(pids) > 1
    assert os.getpid() not in pids


@pytest.mark.parametrize("kind", [InputError, SolverError])
def test_what_a_job_raises_comes_back_and_the_others_are_done(kind):
    with crew(workers=2) as doers:
        jobs = [doers.submit(fail, kind), doers.submit(os.getpid)]
        assert set(doers.finished(jobs)) == set(jobs)
        with pytest.raises(kind, match="it went wrong"):
            jobs[0].result()
        assert jobs[1].result() == os.getpid()


@needs_solver
def test_a_worker_is_asked_for_folder_version_and_solver(tmp_path):
    with locked(tmp_path) as token:
        assert what_is_missing(tmp_path, token, worker_pool.__version__) is None
        assert "does not see" in what_is_missing(tmp_path / "elsewhere", token, worker_pool.__version__)
        assert "does not see" in what_is_missing(tmp_path, "another run's", worker_pool.__version__)
        assert "but 99.0 is wanted" in what_is_missing(tmp_path, token, "99.0")
        with crew(workers=1) as doers:
            doers.require(tmp_path, token)
            with pytest.raises(InputError, match="does not see"):
                doers.require(tmp_path, "another run's")


def test_something_else_at_the_address_is_told_within_seconds(monkeypatch):
    monkeypatch.setattr(worker_pool, "PATIENCE", 0.3)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(InputError, match=f"no dask scheduler answers at {address}"), crew(scheduler=address):
            pass


def test_a_scheduler_without_workers_is_told_within_seconds(monkeypatch):
    from distributed import LocalCluster

    monkeypatch.setattr(worker_pool, "WORKER_PATIENCE", 0.3)
    with (
        LocalCluster(
            n_workers=0, processes=True, dashboard_address="127.0.0.1:0", silence_logs=worker_pool.SILENT
        ) as cluster,
        pytest.raises(InputError, match="has no workers; start some: dask worker tcp://"),
        crew(scheduler=cluster.scheduler_address),
    ):
        pass


def test_what_dask_logs_is_as_it_was_when_the_work_is_over():
    logger = logging.getLogger("distributed")
    before = logger.level
    with crew(workers=1):
        assert not logger.isEnabledFor(logging.CRITICAL)
    assert logger.level == before


def frames_without_end(ended):
    try:
        while True:
            time.sleep(0.01)
            yield "frame"
    finally:
        ended.touch()


def go_through(begun, ended):
    for _ in while_wanted(frames_without_end(ended)):
        begun.touch()


def test_frames_go_on_only_while_somebody_wants_them(tmp_path):
    begun, ended = tmp_path / "begun", tmp_path / "ended"
    with crew(workers=1) as doers:
        waiting = doers.submit(go_through, begun, ended)
        while not begun.exists():
            time.sleep(0.01)
        assert not waiting.done()
        assert not ended.exists()
    assert ended.exists()
