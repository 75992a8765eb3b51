"""Warp's start, its types by precision, and one clear line where it cannot run here."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from typing import Any

import torch
import warp as wp

from surfsup.errors import SimulationError

wp.config.log_level = wp.LOG_WARNING  # no banner


@dataclass(frozen=True)
class Precision:
    """Warp's types of a torch precision.

    Attributes:
        name: suffix of the modules that are compiled for it.
        real: the number.
        vec3: three numbers.
        mat33: a matrix.
    """

    name: str
    real: type
    vec3: type
    mat33: type

    @classmethod
    def of(cls, dtype: torch.dtype) -> Precision:
        """The types for a torch ``dtype``.

        Raises:
            SimulationError: it is neither single nor double precision.
        """
        return precision(dtype)


@cache
def precision(dtype: torch.dtype) -> Precision:
    """:meth:`Precision.of`, the same object for the same ``dtype``."""
    if dtype == torch.float32:
        return Precision("float32", wp.float32, wp.vec3f, wp.mat33f)
    if dtype == torch.float64:
        return Precision("float64", wp.float64, wp.vec3d, wp.mat33d)
    raise SimulationError(f"the solver computes in single and double precision, not in {str(dtype).removeprefix('torch.')}")


def stream_of(device: torch.device) -> AbstractContextManager[Any]:
    """Let Warp launch kernels on torch's current stream of a GPU."""
    if device.type != "cuda":
        return nullcontext()
    return wp.ScopedStream(wp.stream_from_torch(torch.cuda.current_stream(device)))


@contextmanager
def clear_errors(device: torch.device) -> Iterator[None]:
    """Name the cause and the way out where Warp cannot compile, cache or launch its kernels.

    Raises:
        SimulationError: with one line.
    """
    try:
        yield
    except OSError as error:
        raise SimulationError(
            f"Warp cannot write its compiled kernels to {wp.config.kernel_cache_dir} ({error.strerror or error}); "
            "set WARP_CACHE_PATH to a directory that can be written"
        ) from None
    except RuntimeError as error:
        if isinstance(error, SimulationError):
            raise
        lines = str(error).strip().splitlines() or [type(error).__name__]
        way_out = "" if device.type == "cpu" else "; try --device cpu"
        raise SimulationError(f"Warp's kernels cannot run on {device} ({lines[0]}){way_out}") from None
