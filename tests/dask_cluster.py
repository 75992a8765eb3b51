"""A dask cluster of processes, as a user would start it, whose workers a test can kill."""

import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml


def start_dask(role: str, *options: str) -> subprocess.Popen:
    """Start a scheduler or a worker as a process, as in a user's cluster."""
    command = [sys.executable, "-m", f"distributed.cli.dask_{role}", "--no-dashboard", *options]
    return subprocess.Popen(command, stderr=subprocess.DEVNULL)


@dataclass
class Cluster:
    """A scheduler with workers that a test can kill."""

    address: str
    folder: Path
    workers: list[subprocess.Popen]

    def add_worker(self) -> None:
        own = ["--no-nanny", "--nthreads", "1", "--local-directory", str(self.folder)]
        self.workers.append(start_dask("worker", self.address, *own))


@pytest.fixture
def cluster(tmp_path_factory):
    from distributed import Client

    folder = tmp_path_factory.mktemp("dask")
    address_file = folder / "scheduler.json"
    scheduler = start_dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(address_file))
    workers = []
    try:
        deadline = time.monotonic() + 60
        while not (address_file.exists() and address_file.stat().st_size) and time.monotonic() < deadline:
            time.sleep(0.05)
        running = Cluster(yaml.safe_load(address_file.read_text())["address"], folder, workers)
        running.add_worker()
        running.add_worker()
        with Client(running.address) as client:
            client.wait_for_workers(2, timeout=60)
        yield running
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()
