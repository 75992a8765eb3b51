"""The convolution's sums over neighbors in C++, with their gradients: what training spends its time on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup import native

if TYPE_CHECKING:
    from surfsup.sph.kernel_sums import Graph

CHANNELS = 16  # the convolution is compiled for multiples of these
FOUR = 4  # values a particle that the kernel sums are compiled for


def can_convolve(graph: Graph, hidden: Tensor, mix: Tensor) -> bool:
    """Whether :class:`NativeConvolution` is built and made for these."""
    whole = hidden.shape[1] % CHANNELS == 0 and mix.shape[1] % CHANNELS == 0
    return can_sum(graph, hidden) and whole and mix.dtype == torch.float32


def can_sum(graph: Graph, values: Tensor) -> bool:
    """Whether native sums over neighbors are built, all is single precision on the CPU, and no kernel learns."""
    kernels = graph.kernels
    return (
        bool(native.instruction_sets())
        and values.dtype == kernels.dtype == torch.float32
        and values.device.type == kernels.device.type == "cpu"
        and not (torch.is_grad_enabled() and kernels.requires_grad)
    )


class NativeConvolution(torch.autograd.Function):
    """own h_i + sum_j sum_m k_m(i, j) mix_m h_j, of whose channels the first M count.

    Nothing of N x 4 x M is kept: going back makes the sums anew.
    """

    @staticmethod
    def forward(context: Any, hidden: Tensor, mix: Tensor, own: Tensor, graph: Graph) -> Tensor:
        """Hidden (N, C), mix (4C, M), own (C, C) -> (N, C)."""
        hidden, mix, own = hidden.contiguous(), mix.contiguous(), own.contiguous()
        context.save_for_backward(hidden, mix, own)
        context.graph = graph
        out = torch.empty_like(hidden)
        native.convolve(*edges(graph), *arrays(hidden, mix, own, out), torch.get_num_threads())
        return out

    @staticmethod
    @once_differentiable
    def backward(context: Any, gradient: Tensor) -> tuple[Tensor | None, Tensor, Tensor, None]:
        """Gradients in what went in."""
        hidden, mix, own = context.saved_tensors
        to_mix, to_own = torch.empty_like(mix), torch.empty_like(own)
        to_hidden = torch.empty_like(hidden) if context.needs_input_grad[0] else None
        native.convolve_back(
            *edges(context.graph),
            *arrays(hidden, mix, own, gradient.contiguous()),
            None if to_hidden is None else to_hidden.numpy(),
            *arrays(to_mix, to_own),
            torch.get_num_threads(),
        )
        return to_hidden, to_mix, to_own, None


class NativeKernelSums(torch.autograd.Function):
    """The sum over neighbors for every kernel apart, of four values a particle."""

    @staticmethod
    def forward(context: Any, values: Tensor, graph: Graph) -> Tensor:
        """(N, 4) values of the senders -> (N, 4, 4) sums of the receivers."""
        context.graph = graph
        sums = values.new_empty(len(graph), graph.kernels.shape[1], FOUR)
        native.sum_fours(*edges(graph), *arrays(values.contiguous(), sums), torch.get_num_threads())
        return sums

    @staticmethod
    @once_differentiable
    def backward(context: Any, gradient: Tensor) -> tuple[Tensor, None]:
        """The gradient in the values."""
        to_values = gradient.new_empty(len(gradient), FOUR)
        native.sum_fours_back(*edges(context.graph), *arrays(gradient.contiguous(), to_values), torch.get_num_threads())
        return to_values, None


def edges(graph: Graph) -> list[Any]:
    """Starts, senders and kernels as arrays."""
    return arrays(graph.neighborhood.starts, graph.neighborhood.senders, graph.kernels.contiguous())


def arrays(*tensors: Tensor) -> list[Any]:
    """The same memory as arrays of NumPy."""
    return [tensor.detach().numpy() for tensor in tensors]
