"""A GPU for machines that have none: tensors that say they lie on it, and refuse to meet those of the CPU.

They are computed on the CPU. So a test finds what would end with "expected all tensors to be on the same device", or
with a NumPy array asked of a GPU's tensor; not what a GPU computes, nor which of torch's functions it lacks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch
from weakref import WeakValueDictionary

import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map

GPU = torch.device("cuda:0")
BENEATH = "meta"  # the device that torch's own C++ sees: it is not the CPU, and every torch has it
MOVES = (torch.ops.aten._to_copy.default, torch.ops.aten.copy_.default)


class OnGpu(torch.Tensor):
    """One that says that it is there.

    Attributes:
        values: what it holds, on the CPU.
    """

    @staticmethod
    def __new__(cls, values: torch.Tensor) -> OnGpu:
        return torch.Tensor._make_wrapper_subclass(
            cls, values.shape, strides=values.stride(), dtype=values.dtype, device=BENEATH
        )

    def __init__(self, values: torch.Tensor) -> None:
        self.values = values

    @classmethod
    def __torch_function__(
        cls, function: Callable[..., Any], types: Any, given: tuple[Any, ...] = (), named: dict[str, Any] | None = None
    ) -> Any:
        if function == torch.Tensor.device.__get__:
            return GPU
        if function == torch.Tensor.new_tensor:
            return torch.tensor(given[1], dtype=given[0].dtype).to(GPU)
        with torch._C.DisableTorchFunctionSubclass():
            return function(*given, **(named or {}))

    @classmethod
    def __torch_dispatch__(
        cls, function: Any, types: Any, given: tuple[Any, ...] = (), named: dict[str, Any] | None = None
    ) -> Any:
        return computed(function, given, named or {})


class Pretence(TorchDispatchMode):
    """What asks for the GPU gets it; and where both kinds meet, it ends."""

    def __torch_dispatch__(
        self, function: Any, types: Any, given: tuple[Any, ...] = (), named: dict[str, Any] | None = None
    ) -> Any:
        return computed(function, given, named or {})


# Sparse matrices can't say where they lie: those that do are kept here by their address.
sparse_ones: WeakValueDictionary[int, torch.Tensor] = WeakValueDictionary()


def is_there(tensor: torch.Tensor) -> bool:
    """Whether it pretends to lie on the GPU."""
    return isinstance(tensor, OnGpu) or id(tensor) in sparse_ones


def computed(function: Any, given: tuple[Any, ...], named: dict[str, Any]) -> Any:
    """What the function comes to, on the device that it would be on.

    Raises:
        RuntimeError: tensors of both devices meet; numbers of the CPU may.
    """
    tensors = [leaf for leaf in tree_leaves((given, named)) if isinstance(leaf, torch.Tensor)]
    there = any(is_there(tensor) for tensor in tensors)
    if there and function not in MOVES and any(tensor.ndim and not is_there(tensor) for tensor in tensors):
        raise RuntimeError(f"{function}: expected all tensors to be on the same device")
    asked = named.get("device")
    to_gpu = there if asked is None else torch.device(asked).type != "cpu"
    values = tree_map(lambda leaf: leaf.values if isinstance(leaf, OnGpu) else leaf, (given, named))
    if asked is not None:
        values[1]["device"] = torch.device("cpu")
    result = function(*values[0], **values[1])
    if function._schema.is_mutable:
        return given[0]
    return tree_map(lambda leaf: put(leaf) if to_gpu and isinstance(leaf, torch.Tensor) else leaf, result)


def put(values: torch.Tensor) -> torch.Tensor:
    """The same as if it lay on the GPU."""
    if values.layout == torch.strided:
        return OnGpu(values)
    sparse_ones[id(values)] = values
    return values


@contextmanager
def pretended_gpu() -> Iterator[torch.device]:
    """Within it tensors can be moved to the device that it gives."""
    lifted = torch._C._only_lift_cpu_tensors()
    torch._C._set_only_lift_cpu_tensors(True)
    try:
        with patch.object(torch.cuda, "_lazy_init"), Pretence():
            yield GPU
    finally:
        torch._C._set_only_lift_cpu_tensors(lifted)
