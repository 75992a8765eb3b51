"""A neighbor convolution with the solver's own kernels.

An edge carries the smoothing kernel and its gradient, the kernels with which the solver sums density and pressure.
The layer is a learned mixture of the four:

    out_i = self h_i + sum_j sum_m k_m(i, j) mix_m h_j
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from surfsup import native
from surfsup.sph.kernel_sums import KERNELS, KernelGraph, as_array, can_sum_native, graph_arrays

NATIVE_CHANNELS = 16  # the C++ convolution is compiled for multiples of these


def convolve(hidden: Tensor, mix: Tensor, self_weight: Tensor, graph: KernelGraph) -> Tensor:
    """The convolution of hidden states (N, C) -> (N, C).

    Args:
        hidden: (N, C).
        mix: (4C, C), the matrix of each kernel.
        self_weight: (C, C).
        graph: neighbors and kernels.
    """
    if can_convolve_native(graph, hidden, mix):
        return NativeConvolution.apply(hidden, mix, self_weight, graph)
    count, width = hidden.shape
    messages = nn.functional.linear(hidden, mix).reshape(count, KERNELS, width)
    return GatherMessages.apply(messages, graph.kernels, graph) + nn.functional.linear(hidden, self_weight)


def can_convolve_native(graph: KernelGraph, hidden: Tensor, mix: Tensor) -> bool:
    """Whether C++ can compute the convolution: it has gradients in hidden states and weights, not in the kernels."""
    return hidden.shape[1] % NATIVE_CHANNELS == 0 and mix.dtype == torch.float32 and can_sum_native(graph, hidden)


class GatherMessages(torch.autograd.Function):
    """The sum over neighbors and kernels as a sparse product, with both of its gradients."""

    @staticmethod
    def forward(context: Any, messages: Tensor, kernels: Tensor, graph: KernelGraph) -> Tensor:
        """Messages (N, 4, C) of senders -> (N, C). ``kernels`` are the graph's, an argument for their gradient."""
        context.save_for_backward(messages if context.needs_input_grad[1] else messages.new_empty(0))
        context.graph = graph
        return graph.gather_matrix @ messages.flatten(0, 1)

    @staticmethod
    def backward(context: Any, *gradients: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        """Gradients in the messages and in the kernels."""
        (gradient,) = gradients
        graph = context.graph
        in_messages = in_kernels = None
        if context.needs_input_grad[0]:
            in_messages = (graph.scatter_matrix @ gradient.contiguous()).unflatten(0, (len(graph), KERNELS))
        if context.needs_input_grad[1]:
            (messages,) = context.saved_tensors
            # The gradient of an edge's kernel is the product of the edge's message and gradient. Gathering both for
            # every edge would be an order of magnitude slower than this sampled product (measured).
            products = torch.sparse.sampled_addmm(
                graph.gather_matrix, gradient.contiguous(), messages.flatten(0, 1).T, beta=0.0
            )
            in_kernels = products.values().unflatten(0, (-1, KERNELS))
        return in_messages, in_kernels, None


class NativeConvolution(torch.autograd.Function):
    """:func:`convolve` in C++. It stores no messages: the gradient sums them again."""

    @staticmethod
    def forward(context: Any, hidden: Tensor, mix: Tensor, self_weight: Tensor, graph: KernelGraph) -> Tensor:
        """Hidden (N, C), mix (4C, C), self (C, C) -> (N, C)."""
        context.save_for_backward(hidden, mix, self_weight)
        context.graph = graph
        out = hidden.new_empty(hidden.shape)
        weights = as_array(mix), as_array(self_weight)
        native.convolve(*graph_arrays(graph), as_array(hidden), *weights, as_array(out), torch.get_num_threads())
        return out

    @staticmethod
    @once_differentiable
    def backward(context: Any, *gradients: Tensor) -> tuple[Tensor | None, Tensor, Tensor, None]:
        """Gradients in hidden states and weights."""
        hidden, mix, self_weight = context.saved_tensors
        in_mix, in_self = mix.new_empty(mix.shape), self_weight.new_empty(self_weight.shape)
        in_hidden = hidden.new_empty(hidden.shape) if context.needs_input_grad[0] else None
        native.convolve_gradient(
            *graph_arrays(context.graph),
            as_array(hidden),
            as_array(mix),
            as_array(self_weight),
            as_array(gradients[0]),
            None if in_hidden is None else as_array(in_hidden),
            as_array(in_mix),
            as_array(in_self),
            torch.get_num_threads(),
        )
        return in_hidden, in_mix, in_self, None
