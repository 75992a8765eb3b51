"""A simulated GPU for machines without one: tensors that report a GPU as their device and refuse those of the CPU.

The CPU computes them. A test with such tensors finds code that would fail with "expected all tensors to be on the same
device", or that converts a GPU's tensor to a NumPy array. It does not find what a GPU computes differently.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any
from unittest.mock import patch
from weakref import WeakValueDictionary

import torch
import warp
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map

from surfsup import warp_runtime as runtime

GPU = torch.device("cuda:0")
INTERNAL_DEVICE = "meta"  # the device in torch's C++: it is not the CPU, and every build of torch has it
COPIES = (torch.ops.aten._to_copy.default, torch.ops.aten.copy_.default)


class GpuTensor(torch.Tensor):
    """A tensor that reports the GPU as its device.

    Attributes:
        values: the same tensor on the CPU.
    """

    @staticmethod
    def __new__(cls, values: torch.Tensor) -> GpuTensor:
        return torch.Tensor._make_wrapper_subclass(
            cls, values.shape, strides=values.stride(), dtype=values.dtype, device=INTERNAL_DEVICE
        )

    def __init__(self, values: torch.Tensor) -> None:
        self.values = values

    @classmethod
    def __torch_function__(
        cls, function: Callable[..., Any], types: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        if function == torch.Tensor.device.__get__:
            return GPU
        if function == torch.Tensor.new_tensor:
            return torch.tensor(args[1], dtype=args[0].dtype).to(GPU)
        with torch._C.DisableTorchFunctionSubclass():
            return function(*args, **(kwargs or {}))

    @classmethod
    def __torch_dispatch__(
        cls, function: Any, types: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        return compute(function, args, kwargs or {})


class SimulatedGpu(TorchDispatchMode):
    """Creates tensors on the simulated GPU, and refuses operations on tensors of both devices."""

    def __torch_dispatch__(
        self, function: Any, types: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        return compute(function, args, kwargs or {})


# Sparse tensors cannot be wrapped; those on the GPU are listed here by address.
sparse_on_gpu: WeakValueDictionary[int, torch.Tensor] = WeakValueDictionary()


def is_on_gpu(tensor: torch.Tensor) -> bool:
    """Whether the tensor is on the simulated GPU."""
    return isinstance(tensor, GpuTensor) or id(tensor) in sparse_on_gpu


def compute(function: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
    """The function's result, on the device where torch would put it.

    Raises:
        RuntimeError: the arguments are on both devices. Scalars may be on the CPU.
    """
    tensors = [leaf for leaf in tree_leaves((args, kwargs)) if isinstance(leaf, torch.Tensor)]
    on_gpu = any(is_on_gpu(tensor) for tensor in tensors)
    if on_gpu and function not in COPIES and any(tensor.ndim and not is_on_gpu(tensor) for tensor in tensors):
        raise RuntimeError(f"{function}: expected all tensors to be on the same device")
    device = kwargs.get("device")
    if on_gpu and waits_for_gpu(function, args, device):
        waits.append(str(function))
    to_gpu = on_gpu if device is None else torch.device(device).type != "cpu"
    values = tree_map(lambda leaf: leaf.values if isinstance(leaf, GpuTensor) else leaf, (args, kwargs))
    if device is not None:
        values[1]["device"] = torch.device("cpu")
    result = function(*values[0], **values[1])
    if function._schema.is_mutable:
        return args[0]
    return tree_map(lambda leaf: to_gpu_tensor(leaf) if to_gpu and isinstance(leaf, torch.Tensor) else leaf, result)


# Operations for which the host has waited for the GPU.
waits: list[str] = []


def waits_for_gpu(function: Any, args: tuple[Any, ...], device: Any) -> bool:
    """Whether the host must wait for the GPU: it reads a value, or the shape of the result depends on values."""
    if function in COPIES:
        to_host = device is not None and torch.device(device).type == "cpu"
        return to_host or (function == torch.ops.aten.copy_.default and not is_on_gpu(args[0]))
    if function == torch.ops.aten.index.Tensor:
        return any(index is not None and index.dtype == torch.bool for index in args[1])
    return function in WAITING


WAITING = (
    torch.ops.aten._local_scalar_dense.default,
    torch.ops.aten.equal.default,
    torch.ops.aten.masked_select.default,
    torch.ops.aten.nonzero.default,
)


def to_gpu_tensor(values: torch.Tensor) -> torch.Tensor:
    """The tensor on the simulated GPU."""
    if values.layout == torch.strided:
        return GpuTensor(values)
    sparse_on_gpu[id(values)] = values
    return values


@contextmanager
def warp_on_the_cpu() -> Iterator[None]:
    """A context in which Warp computes on the CPU where the tensors report the simulated GPU."""
    start, load_kernels, to_warp, to_torch = runtime.start, runtime.load_kernels, runtime.to_warp, runtime.to_torch

    def to_warp_from_gpu(tensor: torch.Tensor | None, dtype: type) -> Any:
        assert tensor is None or is_on_gpu(tensor)
        return None if tensor is None else to_warp(tensor.detach().contiguous().values, dtype)

    with (
        patch.object(runtime, "start", lambda device: start("cpu")),
        patch.object(runtime, "load_kernels", lambda kernels, device: load_kernels(kernels, "cpu")),
        patch.object(runtime, "on_stream", lambda device: nullcontext()),
        patch.object(runtime, "warp_device", lambda device: warp.get_device("cpu")),
        patch.object(runtime, "to_warp", to_warp_from_gpu),
        patch.object(runtime, "to_torch", lambda array: to_gpu_tensor(to_torch(array))),
    ):
        yield


@contextmanager
def simulated_gpu() -> Iterator[torch.device]:
    """A context in which tensors can be moved to the device that it yields."""
    lifted = torch._C._only_lift_cpu_tensors()
    torch._C._set_only_lift_cpu_tensors(True)
    try:
        with patch.object(torch.cuda, "_lazy_init"), warp_on_the_cpu(), SimulatedGpu():
            yield GPU
    finally:
        torch._C._set_only_lift_cpu_tensors(lifted)
