"""Warp's start, its types by precision, and one clear line where it cannot run here."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from typing import Any

import torch
import warp as wp
from torch import Tensor

from surfsup.errors import InputError

STANDARD_ERROR = 2  # file descriptor
DRIVER_WARNINGS = ("find or load the NVIDIA CUDA driver", "CUDA driver version", "https://nvidia.github.io/warp")
NO_MEMORY = ("failed to allocate", "out of memory", "can't allocate memory")  # in errors of Warp and of torch

wp.config.log_level = wp.LOG_ERROR  # no banner


@dataclass(frozen=True)
class Precision:
    """Warp's types of a torch precision.

    Attributes:
        name: suffix of the modules that are compiled for it.
        real: a number.
        vec3: three numbers.
        mat33: three by three numbers.
    """

    name: str
    real: type
    vec3: type
    mat33: type


@cache
def precision_of(dtype: torch.dtype) -> Precision:
    """Warp's types of a ``dtype``, the same object in every call.

    Raises:
        InputError: it is neither single nor double precision.
    """
    if dtype == torch.float32:
        return Precision("float32", wp.float32, wp.vec3f, wp.mat33f)
    if dtype == torch.float64:
        return Precision("float64", wp.float64, wp.vec3d, wp.mat33d)
    raise InputError(f"the solver computes in float32 or float64, not in {str(dtype).removeprefix('torch.')}")


@cache
def start(device: str) -> None:
    """Initialize Warp for a device of torch.

    Raises:
        InputError: Warp's cache cannot be written, or it finds no driver for the device.
    """
    try:
        with without_driver_warning():
            wp.init()
        if device != "cpu" and not wp.is_cuda_available():
            raise RuntimeError(driver_problem(wp.get_cuda_driver_version(), wp.get_cuda_toolkit_version()))
        wp.get_device(device)
    except OSError as error:
        raise cache_error(error) from None
    except Exception as error:
        raise launch_error(device, error) from None


def driver_problem(driver: tuple[int, int] | None, toolkit: tuple[int, int] | None) -> str:
    """Why Warp cannot use a GPU, by the CUDA versions of the driver, None without one, and of Warp itself."""
    if toolkit is None:
        return "this build of Warp is for CPUs alone"
    if driver is None:
        return "there is no NVIDIA driver"
    if driver[0] < toolkit[0]:
        return f"the NVIDIA driver is for CUDA {driver[0]}.{driver[1]}, but Warp needs one for CUDA {toolkit[0]}"
    return "the NVIDIA driver finds no GPU"


@contextmanager
def without_driver_warning() -> Iterator[None]:
    """Leave out Warp's line on standard error that a machine without an NVIDIA GPU has no driver for one."""
    with tempfile.TemporaryFile() as written:
        sys.stderr.flush()
        kept = os.dup(STANDARD_ERROR)
        os.dup2(written.fileno(), STANDARD_ERROR)
        try:
            yield
        finally:
            os.dup2(kept, STANDARD_ERROR)
            os.close(kept)
            written.seek(0)
            lines = written.read().decode(errors="replace").splitlines(keepends=True)
            sys.stderr.writelines(line for line in lines if not any(words in line for words in DRIVER_WARNINGS))


def load_kernels(kernels: Iterable[Any], device: str) -> None:
    """Compile the modules of ``kernels`` for a device, or read them from Warp's cache.

    Raises:
        InputError: Warp's cache cannot be written, or a kernel fails to compile.
    """
    try:
        for module in dict.fromkeys(kernel.module for kernel in kernels):
            module.load(wp.get_device(device))
    except OSError as error:
        raise cache_error(error) from None
    except Exception as error:
        raise launch_error(device, error) from None


def cache_error(error: OSError) -> InputError:
    """The error for a cache of compiled kernels that cannot be written."""
    return InputError(
        f"Warp cannot write its compiled kernels to {wp.config.kernel_cache_dir or 'its cache'} "
        f"({error.strerror or error}); set WARP_CACHE_PATH to a directory that can be written"
    )


def launch_error(device: str, error: Exception) -> InputError:
    """The error for kernels that do not compile or run on a device."""
    reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
    way_out = "install a C++ compiler and build surfsup with it" if device == "cpu" else "try --device cpu"
    return InputError(f"Warp's kernels cannot run on the device '{device}' ({reason}); {way_out}")


@contextmanager
def memory_errors(particles: int, bytes_per_particle: int, device: torch.device) -> Iterator[None]:
    """Say how many particles would fit where a device has too little memory.

    Raises:
        InputError: with one line.
    """
    try:
        yield
    except RuntimeError as error:
        if not any(words in str(error).lower() for words in NO_MEMORY):
            raise
        memory = torch.cuda.mem_get_info(device)[1] if device.type == "cuda" else 0
        room = f"; about {memory // bytes_per_particle} would fit" if memory else ""
        way_out = "use fewer" if device.type == "cpu" else "use fewer, or --device cpu"
        raise InputError(
            f"the device '{device}' has too little memory for {particles} particles{room}; {way_out}"
        ) from None


def on_stream(device: torch.device) -> AbstractContextManager[Any]:
    """Lets Warp launch on the stream that torch uses on a GPU."""
    if device.type != "cuda":
        return nullcontext()
    return wp.ScopedStream(wp.stream_from_torch(torch.cuda.current_stream(device)))


@contextmanager
def recording(device: Any) -> Iterator[Any]:
    """A context whose launches are recorded, not run; ``graph`` of what it yields holds them."""
    # CUDA cannot record the stream that torch uses by default.
    with wp.ScopedStream(wp.Stream(device)) if device.is_cuda else nullcontext(), wp.ScopedCapture(device) as capture:
        yield capture


def load_for(factory: Callable[[Precision], Any], like: Tensor) -> None:
    """Have the kernels of a group for the precision and device of a tensor.

    Raises:
        InputError: see :func:`start` and :func:`load_kernels`.
    """
    load_group(factory, like.dtype, str(like.device))


@cache
def load_group(factory: Callable[[Precision], Any], dtype: torch.dtype, device: str) -> None:
    """As :func:`load_for`, once for each group, precision and device."""
    start(device)
    load_kernels(factory(precision_of(dtype)).kernels, device)


def warp_device(device: torch.device) -> Any:
    """Warp's device of torch's."""
    return wp.get_device(str(device))


def empty_like(tensor: Tensor) -> Tensor:
    """An uninitialized tensor that a kernel can write: contiguous, without a gradient."""
    return torch.empty_like(tensor, memory_format=torch.contiguous_format, requires_grad=False)


def copy_of(tensor: Tensor) -> Tensor:
    """A copy that a kernel can write: contiguous."""
    return tensor.clone(memory_format=torch.contiguous_format)


def to_warp(tensor: Tensor | None, dtype: type) -> Any:
    """A tensor without its gradient as Warp takes it, None for none; it shares the memory of a contiguous one."""
    return None if tensor is None else wp.from_torch(tensor.detach().contiguous(), dtype=dtype, requires_grad=False)


def to_torch(array: Any) -> Tensor:
    """Warp's array as a tensor that shares its memory."""
    return wp.to_torch(array)
