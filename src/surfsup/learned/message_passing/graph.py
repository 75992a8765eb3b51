"""Edges for message passing, and the two moves between particles and edges: gathering and summing.

Both are done by ``embedding_bag``, which sums rows of a table: one pass, sums in single precision, the same
result every time. It beats ``index_select``, ``index_add_`` and a sparse product (measured).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup.learned.message_passing.products import add_product, times, weight_gradient
from surfsup.sph.neighbor_search import NeighborList, join_neighbor_lists

EDGE_FEATURES = 4


@dataclass(frozen=True)
class EdgeGraph:
    """Edges grouped by receiver and what is told of them.

    Attributes:
        neighborhood: N particles, E directed edges.
        features: (E, 4), displacement from receiver to sender and its length, relative to the radius.
    """

    neighborhood: NeighborList
    features: Tensor

    def __len__(self) -> int:
        """The number of particles."""
        return len(self.neighborhood.starts) - 1

    @cached_property
    def ends(self) -> Tensor:
        """(E, 2): the rows of an edge's sender and receiver in a table that has two rows for each particle."""
        near = self.neighborhood
        return torch.stack([2 * near.senders, 2 * near.receivers + 1], dim=1)

    @cached_property
    def order(self) -> Tensor:
        """(E,): the edges as they come, which is by receiver."""
        return torch.arange(len(self.neighborhood.senders), device=self.neighborhood.senders.device)

    @cached_property
    def order_by_sender(self) -> Tensor:
        """(E,): the edges by sender. With every edge there is its reverse, so the groups start at the same places."""
        return torch.argsort(self.neighborhood.senders, stable=True)

    def sums(self, values: Tensor, order: Tensor) -> Tensor:
        """Sum (E, C) over the edges of each particle, (N, C), the edges taken in ``order``."""
        starts = self.neighborhood.starts
        return torch.nn.functional.embedding_bag(order, values, starts, mode="sum", include_last_offset=True)


def edge_graph(positions: Tensor, neighbors: NeighborList, radius: float) -> EdgeGraph:
    """The graph of ``positions`` (N, 3), its features differentiable in them."""
    sent = positions.index_select(0, neighbors.senders)
    displacement = (sent - positions.index_select(0, neighbors.receivers)) / radius
    distance = torch.linalg.vector_norm(displacement, dim=-1, keepdim=True)
    return EdgeGraph(neighbors, torch.cat([displacement, distance], dim=-1))


def join_graphs(graphs: list[EdgeGraph]) -> EdgeGraph:
    """Several graphs side by side as one, with no edge between them."""
    if len(graphs) == 1:
        return graphs[0]
    merged = join_neighbor_lists([part.neighborhood for part in graphs])
    return EdgeGraph(merged, torch.cat([part.features for part in graphs]))


class FirstEdgeLayer(torch.autograd.Function):
    """The first layer of an edge's perceptron on (edge, sender, receiver), without ever putting the three together.

    The layer's weight has three parts. Those for sender and receiver are applied to the N particles, once each, instead
    of to the E edges, and an edge gathers the two.
    """

    @staticmethod
    def forward(
        context: torch.autograd.function.FunctionCtx,
        ends: Tensor,
        edges: Tensor,
        weight: Tensor,
        graph: EdgeGraph,
    ) -> Tensor:
        """Rectified first layer (E, C).

        Args:
            context: autograd's.
            ends: (N, 2C), what a particle gives to an edge as its sender, and as its receiver.
            edges: (E, D), the state of the edges.
            weight: (C, D), the part of the layer's weight for them.
            graph: the edges.
        """
        count, channels = ends.shape
        table = ends.reshape(2 * count, channels // 2)
        total = torch.nn.functional.embedding_bag(graph.ends, table, mode="sum")
        out = add_product(total, edges, weight).relu_()
        context.save_for_backward(edges, weight, out)
        context.graph = graph
        return out

    @staticmethod
    @once_differentiable
    def backward(context: torch.autograd.function.FunctionCtx, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients in what the particles gave, in the edges and in the weight."""
        edges, weight, out = context.saved_tensors
        graph = context.graph
        gradient = torch.ops.aten.threshold_backward(gradient, out, 0)
        to_ends = torch.cat([graph.sums(gradient, graph.order_by_sender), graph.sums(gradient, graph.order)], dim=1)
        return to_ends, times(gradient, weight.t()), weight_gradient(gradient, edges), None


class SumOverEdges(torch.autograd.Function):
    """The sum of what the edges carry to each receiver."""

    @staticmethod
    def forward(context: torch.autograd.function.FunctionCtx, messages: Tensor, graph: EdgeGraph) -> Tensor:
        """(E, C) -> (N, C)."""
        context.graph = graph
        return graph.sums(messages, graph.order)

    @staticmethod
    @once_differentiable
    def backward(context: torch.autograd.function.FunctionCtx, gradient: Tensor) -> tuple[Tensor, None]:
        """The receiver's gradient for each of its edges."""
        return gradient.index_select(0, context.graph.neighborhood.receivers), None
