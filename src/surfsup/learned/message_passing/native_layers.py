"""The perceptrons of the network in C++, on the rows of a matrix and on the edges of a graph, with their gradients.

A tile of 48 rows goes through all layers of a perceptron while it stays in the processor's cache. Only what the
backward pass needs is written to memory. With bfloat16, sums are in single precision and products round their inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup import native
from surfsup.native.dispatch import can_run_native, fastest_isa, needs_gradient

if TYPE_CHECKING:
    from surfsup.learned.message_passing.graph import EdgeGraph

WIDTH_UNIT = 16  # the C++ code has widths that are multiples of this


class Weights(NamedTuple):
    """The parameters of a perceptron, float32: matrices have one row per output. An edge's first layer has no bias."""

    first: Tensor
    first_bias: Tensor | None
    hidden: Tensor
    hidden_bias: Tensor
    output: Tensor
    output_bias: Tensor
    scale: Tensor
    shift: Tensor

    def arrays(self) -> tuple[np.ndarray | None, ...]:
        """The parameters as the C++ code takes them."""
        return tuple(None if value is None else as_array(value) for value in self)

    def tensors(self) -> list[Tensor]:
        """The parameters that exist."""
        return [value for value in self if value is not None]

    def like(self) -> Weights:
        """Uninitialized tensors of the same shapes."""
        return Weights._make(None if value is None else torch.empty_like(value) for value in self)


def native_precision(features: Tensor, width: int, precision: torch.dtype) -> torch.dtype | None:
    """The precision of the C++ code that stands for ``precision``; None if torch must compute.

    A processor without a dot product of bfloat16 computes in single precision, which is as fast there.
    """
    if not can_run_native(features.detach()) or width % WIDTH_UNIT or precision not in (torch.float32, torch.bfloat16):
        return None
    return precision if precision == torch.bfloat16 and native.has_bfloat16(fastest_isa()) else torch.float32


def apply_to_rows(
    rows: Tensor, weights: Weights, epsilon: float, first: torch.dtype, precision: torch.dtype, out: torch.dtype
) -> Tensor:
    """A perceptron on rows (M, k) float32 -> (M, width) in the precision ``out``.

    Args:
        rows: the input.
        weights: parameters of the perceptron.
        epsilon: of its LayerNorm.
        first: precision of the first layer, float32 or ``precision``.
        precision: precision of the other layers.
        out: float32 or ``precision``.
    """
    if needs_gradient(rows, *weights.tensors()):
        return RowPerceptron.apply(rows, epsilon, first, precision, out, *weights)
    return rows_forward(rows, weights, epsilon, first, precision, out, None)


def apply_to_edges(
    endpoints: Tensor, edges: Tensor, weights: Weights, epsilon: float, graph: EdgeGraph, update_edges: bool
) -> tuple[Tensor, Tensor | None]:
    """Messages on the edges, their sums at the receivers, and the edges plus their messages.

    Args:
        endpoints: (N, 2C), each node's contribution to the first layer as sender and as receiver.
        edges: (E, C), in the precision of the products; that of the endpoints, too.
        weights: parameters of the perceptron; those of the first layer only for the edges.
        epsilon: of its LayerNorm.
        graph: the edges.
        update_edges: whether to compute the new edges.

    Returns:
        The sums (N, C) float32 and the new edges (E, C), or None.
    """
    if needs_gradient(endpoints, edges, *weights.tensors()):
        return EdgePerceptron.apply(endpoints, edges, epsilon, graph, update_edges, *weights)
    return edges_forward(endpoints, edges, weights, epsilon, graph, update_edges, None)


def rows_forward(
    rows: Tensor,
    weights: Weights,
    epsilon: float,
    first: torch.dtype,
    precision: torch.dtype,
    out: torch.dtype,
    kept: tuple[Tensor, ...] | None,
) -> Tensor:
    """:func:`apply_to_rows` without a gradient. Writes what a backward pass needs to ``kept``."""
    result = torch.empty(len(rows), len(weights.scale), dtype=out)
    native.rows_forward(
        as_array(rows),
        weights.arrays(),
        epsilon,
        None if kept is None else as_arrays(kept),
        as_array(result),
        first == torch.bfloat16,
        precision == torch.bfloat16,
        fastest_isa(),
        torch.get_num_threads(),
    )
    return result


def edges_forward(
    endpoints: Tensor,
    edges: Tensor,
    weights: Weights,
    epsilon: float,
    graph: EdgeGraph,
    update_edges: bool,
    kept: tuple[Tensor, ...] | None,
) -> tuple[Tensor, Tensor | None]:
    """:func:`apply_to_edges` without a gradient. Writes what a backward pass needs to ``kept``."""
    received = torch.empty(len(endpoints), edges.shape[1])
    new_edges = torch.empty_like(edges) if update_edges else None
    native.edges_forward(
        graph.neighbors.starts.numpy(),
        graph.neighbors.senders.numpy(),
        as_array(endpoints),
        as_array(edges),
        weights.arrays(),
        epsilon,
        None if kept is None else as_arrays(kept),
        as_array(received),
        None if new_edges is None else as_array(new_edges),
        fastest_isa(),
        torch.get_num_threads(),
    )
    return received, new_edges


class RowPerceptron(torch.autograd.Function):
    """:func:`apply_to_rows` with a gradient."""

    @staticmethod
    def forward(
        ctx: Any,
        rows: Tensor,
        epsilon: float,
        first: torch.dtype,
        precision: torch.dtype,
        out: torch.dtype,
        *parameters: Tensor | None,
    ) -> Tensor:
        """Rows (M, k) float32 -> (M, width)."""
        weights = Weights._make(parameters)
        kept = activations(len(rows), len(weights.scale), precision)
        result = rows_forward(rows, weights, epsilon, first, precision, out, kept)
        ctx.save_for_backward(rows, *kept, *parameters)
        ctx.epsilon, ctx.first = epsilon, first
        return result

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of the rows and of all parameters."""
        rows, *kept = ctx.saved_tensors[:5]
        weights = Weights._make(ctx.saved_tensors[5:])
        to_rows = torch.empty_like(rows, memory_format=torch.contiguous_format) if ctx.needs_input_grad[0] else None
        to_weights = weights.like()
        native.rows_backward(
            as_array(rows),
            weights.arrays(),
            ctx.epsilon,
            as_arrays(kept),
            as_array(gradient),
            None if to_rows is None else as_array(to_rows),
            to_weights.arrays(),
            ctx.first == torch.bfloat16,
            fastest_isa(),
            torch.get_num_threads(),
        )
        return to_rows, None, None, None, None, *to_weights


class EdgePerceptron(torch.autograd.Function):
    """:func:`apply_to_edges` with a gradient."""

    @staticmethod
    def forward(
        ctx: Any,
        endpoints: Tensor,
        edges: Tensor,
        epsilon: float,
        graph: EdgeGraph,
        update_edges: bool,
        *parameters: Tensor | None,
    ) -> tuple[Tensor, Tensor | None]:
        """Endpoints (N, 2C) and edges (E, C) -> sums (N, C) float32 and new edges (E, C)."""
        ctx.set_materialize_grads(False)
        weights = Weights._make(parameters)
        kept = activations(len(edges), len(weights.scale), edges.dtype)
        received, new_edges = edges_forward(endpoints, edges, weights, epsilon, graph, update_edges, kept)
        ctx.save_for_backward(endpoints, edges, *kept, *parameters)
        ctx.epsilon, ctx.graph = epsilon, graph
        return received, new_edges

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, received: Tensor | None, new_edges: Tensor | None) -> tuple[Tensor | None, ...]:
        """Gradients of endpoints, edges and all parameters, from those of the sums and of the new edges."""
        endpoints, edges, *kept = ctx.saved_tensors[:6]
        weights = Weights._make(ctx.saved_tensors[6:])
        if received is None:
            received = torch.zeros(len(endpoints), edges.shape[1])
        to_endpoints, to_edges, to_first = (
            torch.empty(value.shape, dtype=value.dtype) for value in (endpoints, edges, edges)
        )
        to_weights = weights.like()
        native.edges_backward(
            ctx.graph.neighbors.starts.numpy(),
            ctx.graph.neighbors.senders.numpy(),
            as_array(edges),
            weights.arrays(),
            ctx.epsilon,
            as_arrays(kept),
            as_array(received),
            None if new_edges is None else as_array(new_edges),
            as_array(to_edges),
            as_array(to_first),
            as_array(to_endpoints),
            to_weights.arrays(),
            fastest_isa(),
            torch.get_num_threads(),
        )
        return to_endpoints, to_edges, None, None, None, *to_weights


def activations(rows: int, width: int, precision: torch.dtype) -> tuple[Tensor, ...]:
    """Room for what a backward pass needs: both hidden layers, the normalized output, and its inverse deviation."""
    hidden_1, hidden_2, normalized = (torch.empty(rows, width, dtype=precision) for _ in range(3))
    return hidden_1, hidden_2, normalized, torch.empty(rows)


def as_arrays(tensors: Sequence[Tensor]) -> tuple[np.ndarray, ...]:
    """The tensors as the C++ code takes them."""
    return tuple(as_array(values) for values in tensors)


def as_array(values: Tensor) -> np.ndarray:
    """The values without a copy where they are contiguous; numbers of bfloat16 as their bits."""
    values = values.detach().contiguous()
    return (values.view(torch.uint16) if values.dtype == torch.bfloat16 else values).numpy()
