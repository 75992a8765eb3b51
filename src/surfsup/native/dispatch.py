"""The one place that decides whether a computation runs in C++ or in torch."""

from __future__ import annotations

from itertools import chain

import torch
from torch import Tensor, nn

from surfsup import native


def is_built() -> bool:
    """Whether the package was installed with its C++ code."""
    return bool(native.instruction_sets())


def fastest_isa() -> str:
    """The fastest instruction set that this processor has, as the native functions take it.

    Raises:
        IndexError: the C++ code is not built.
    """
    return native.instruction_sets()[0]


def can_run_native(*tensors: Tensor, module: nn.Module | None = None, dtype: torch.dtype = torch.float32) -> bool:
    """Whether C++ code may read ``tensors`` and use ``module`` in place of torch.

    The C++ code must be built, every tensor must have the precision of the C++ function and be on the CPU, and nothing
    may need a gradient, since C++ results carry none. With no arguments the answer is whether the C++ code is built.
    Tensors need not be contiguous: the caller makes them so.

    Args:
        tensors: Inputs of the computation. Detach those whose gradient is not needed, or is computed otherwise.
        module: A surface or network that takes part; only its gradients are checked, not its precision or device.
        dtype: Precision of the C++ function. Nearly all are in single precision.
    """
    return (
        is_built()
        and all(tensor.dtype == dtype and tensor.device.type == "cpu" for tensor in tensors)
        and not needs_gradient(*tensors, module=module)
    )


def needs_gradient(*tensors: Tensor, module: nn.Module | None = None) -> bool:
    """Whether torch is recording gradients and any of ``tensors`` or any tensor of ``module`` requires one."""
    return torch.is_grad_enabled() and (
        any(tensor.requires_grad for tensor in tensors) or bool(tensors_requiring_grad(module))
    )


def tensors_requiring_grad(module: nn.Module | None) -> list[Tensor]:
    """The parameters and buffers of ``module`` that require a gradient, each once; none if there is no module.

    Shape parameters are buffers, so that they may be tensors computed from others; hence buffers count, too.
    """
    if module is None:
        return []
    distinct = {id(tensor): tensor for tensor in chain(module.parameters(), module.buffers())}
    return [tensor for tensor in distinct.values() if tensor.requires_grad]
