import os
import subprocess
import sys
from types import SimpleNamespace

import pytest
import torch

from surfsup.errors import InputError
from surfsup.sph.warp_engine.solver import bytes_per_particle
from surfsup.warp_runtime import (
    driver_problem,
    launch_error,
    load_kernels,
    memory_errors,
    start,
)

FRAME = """
import torch
from surfsup.errors import InputError
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import ParticleState

environment = Environment(None, -torch.ones(3), torch.ones(3), torch.zeros(3))
solver = DfsphSolver()
solver.native = None
try:
    solver.step(ParticleState(torch.zeros(1, 3), torch.zeros(1, 3)), environment)
    print("stepped")
except InputError as error:
    print(error)
"""


def run_frame(**variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", FRAME], env=os.environ | variables, capture_output=True, text=True, check=True
    )


def test_the_first_frame_writes_nothing_to_standard_error():
    done = run_frame()
    assert done.stdout == "stepped\n" and done.stderr == ""


def test_a_cache_that_cannot_be_written_is_one_line_with_the_way_out(tmp_path):
    (tmp_path / "file").write_text("not a directory")
    done = run_frame(WARP_CACHE_PATH=str(tmp_path / "file" / "cache"))
    assert done.stdout.count("\n") == 1
    assert "Warp cannot write its compiled kernels to" in done.stdout and "WARP_CACHE_PATH" in done.stdout


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_gpu_that_is_not_there_is_one_line_with_the_way_out():
    with pytest.raises(InputError, match=r"cannot run on the device 'cuda:0' \(.*\); try --device cpu$"):
        start("cuda:0")


@pytest.mark.parametrize(
    ("driver", "toolkit", "reason"),
    [
        (None, (12, 9), "there is no NVIDIA driver"),
        ((11, 8), (12, 9), "the NVIDIA driver is for CUDA 11.8, but Warp needs one for CUDA 12"),
        ((13, 0), (12, 9), "the NVIDIA driver finds no GPU"),
        ((12, 4), None, "this build of Warp is for CPUs alone"),
    ],
)
def test_the_reason_why_there_is_no_gpu(driver, toolkit, reason):
    assert driver_problem(driver, toolkit) == reason


def test_a_kernel_that_does_not_compile_is_one_line():
    class BrokenModule:
        def load(self, device) -> None:
            raise RuntimeError("CPU kernel build failed with error code 1\nand more")

    broken = SimpleNamespace(module=BrokenModule())
    start("cpu")
    with pytest.raises(InputError, match=r"'cpu' \(CPU kernel build failed with error code 1\); install"):
        load_kernels([broken], "cpu")


def test_too_little_memory_says_how_many_particles_would_fit(monkeypatch):
    monkeypatch.setattr(torch.cuda, "mem_get_info", lambda device: (10**6, 8 * 10**9))
    needed = bytes_per_particle(torch.float32, with_gradient=False)
    with (
        pytest.raises(
            InputError,
            match=r"too little memory for 20000000 particles; about \d+ would fit; use fewer, or --device cpu",
        ),
        memory_errors(20_000_000, needed, torch.device("cuda:0")),
    ):
        raise RuntimeError("Failed to allocate 5120000000 bytes on device 'cuda:0'")
    with (
        pytest.raises(InputError, match=r"the device 'cpu' has too little memory for 9 particles; use fewer$"),
        memory_errors(9, needed, torch.device("cpu")),
    ):
        raise RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried to allocate 40 bytes")
    with pytest.raises(RuntimeError, match="another"), memory_errors(1, needed, torch.device("cpu")):
        raise RuntimeError("another")


def test_an_error_without_words_is_named_by_its_type():
    assert "(KeyError)" in str(launch_error("cuda:0", KeyError()))
