"""Compiling Warp's kernels for GPUs on a machine without one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import torch
import warp as wp

from surfsup.warp_runtime import precision_of, start


def assert_compile(
    factories: Iterable[Callable[..., Any]], architecture: int, dtype: torch.dtype, folder: Path
) -> None:
    """All kernels of the factories compile for an architecture, such as 90, in a precision."""
    start("cpu")
    precision, modules = precision_of(dtype), {}
    for factory in factories:
        for kernel in factory(precision).kernels:
            modules[kernel.module.name] = kernel.module
    for module in modules.values():
        paths = wp.compile_aot_module(module, arch=architecture, module_dir=folder, use_ptx=True)
        assert any(f".target sm_{architecture}" in Path(path).read_text() for path in paths)
