"""The edges of the graph, and the two operations between nodes and edges: gather and sum.

Both use ``embedding_bag``, which sums rows of a table in one pass, in single precision and deterministically. It is
faster than ``index_select``, ``index_add_`` and a sparse product (measured).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup.learned.message_passing.linear import add_linear_, linear, weight_gradient
from surfsup.sph.neighbor_search import NeighborList, join_neighbor_lists

EDGE_FEATURES = 4


@dataclass(frozen=True)
class EdgeGraph:
    """Directed edges, grouped by receiver, and their features.

    Attributes:
        neighbors: the E edges between N nodes.
        edge_features: (E, 4), displacement from receiver to sender and its length, in units of the radius.
    """

    neighbors: NeighborList
    edge_features: Tensor

    @cached_property
    def endpoint_rows(self) -> Tensor:
        """(E, 2): the rows of an edge's sender and receiver in a table with two rows for each node."""
        return torch.stack([2 * self.neighbors.senders, 2 * self.neighbors.receivers + 1], dim=1)

    @cached_property
    def order_by_receiver(self) -> Tensor:
        """(E,): the edges in their own order, which is by receiver."""
        return torch.arange(len(self.neighbors.senders), device=self.neighbors.senders.device)

    @cached_property
    def order_by_sender(self) -> Tensor:
        """(E,): the edges ordered by sender. Every edge has its reverse, so the groups start at the same places."""
        return torch.argsort(self.neighbors.senders, stable=True)

    def sum_edges(self, values: Tensor, order: Tensor) -> Tensor:
        """Sum values (E, C) over the edges of each node, (N, C); ``order`` selects the end of an edge that counts."""
        starts = self.neighbors.starts
        return torch.nn.functional.embedding_bag(order, values, starts, mode="sum", include_last_offset=True)


def build_graph(positions: Tensor, neighbors: NeighborList, radius: float) -> EdgeGraph:
    """The graph of ``positions`` (N, 3) in meters. Its edge features are differentiable in the positions."""
    senders = positions.index_select(0, neighbors.senders)
    displacement = (senders - positions.index_select(0, neighbors.receivers)) / radius
    distance = torch.linalg.vector_norm(displacement, dim=-1, keepdim=True)
    return EdgeGraph(neighbors, torch.cat([displacement, distance], dim=-1))


def batch_graphs(graphs: list[EdgeGraph]) -> EdgeGraph:
    """Several graphs as one, without edges between them."""
    if len(graphs) == 1:
        return graphs[0]
    neighbors = join_neighbor_lists([graph.neighbors for graph in graphs])
    return EdgeGraph(neighbors, torch.cat([graph.edge_features for graph in graphs]))


class FirstEdgeLayer(torch.autograd.Function):
    """The first layer of an edge MLP on (edge, sender, receiver), without concatenating the three.

    The weight has three parts. Those of sender and receiver are applied to the N nodes instead of the E edges, and each
    edge gathers the two results.
    """

    @staticmethod
    def forward(ctx: Any, endpoints: Tensor, edges: Tensor, weight: Tensor, graph: EdgeGraph) -> Tensor:
        """The output of the first layer after ReLU (E, C).

        Args:
            ctx: autograd's context.
            endpoints: (N, 2C), each node's contribution to an edge as its sender and as its receiver.
            edges: (E, D), latent vectors of the edges.
            weight: (C, D), the part of the weight for the edges.
            graph: the edges.
        """
        count, channels = endpoints.shape
        table = endpoints.reshape(2 * count, channels // 2)
        total = torch.nn.functional.embedding_bag(graph.endpoint_rows, table, mode="sum")
        output = add_linear_(total, edges, weight).relu_()
        ctx.save_for_backward(edges, weight, output)
        ctx.graph = graph
        return output

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of the endpoints' contributions, of the edges and of the weight."""
        edges, weight, output = ctx.saved_tensors
        graph: EdgeGraph = ctx.graph
        gradient = torch.ops.aten.threshold_backward(gradient, output, 0)
        to_senders = graph.sum_edges(gradient, graph.order_by_sender)
        to_receivers = graph.sum_edges(gradient, graph.order_by_receiver)
        to_endpoints = torch.cat([to_senders, to_receivers], dim=1)
        return to_endpoints, linear(gradient, weight.t()), weight_gradient(gradient, edges), None


class SumMessages(torch.autograd.Function):
    """The sum of the messages at each receiver."""

    @staticmethod
    def forward(ctx: Any, messages: Tensor, graph: EdgeGraph) -> Tensor:
        """(E, C) -> (N, C)."""
        ctx.graph = graph
        return graph.sum_edges(messages, graph.order_by_receiver)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        """The gradient of each message is that of its receiver."""
        return gradient.index_select(0, ctx.graph.neighbors.receivers), None
