"""The paper's graph network: encoder, processor, decoder (supplement, section 6).

The processor's steps have their own weights. A step computes messages on the edges and sums them at the nodes:

    m_ij = f(e_ij, v_j, v_i)        e_ij <- e_ij + m_ij        v_i <- v_i + g(v_i, sum_j m_ij)

As in the code of GNS (Sanchez-Gonzalez et al. 2020), nodes sum the messages m_ij, not the updated edges e_ij.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn

from surfsup.learned.message_passing.graph import EDGE_FEATURES, EdgeGraph, FirstEdgeLayer, SumMessages
from surfsup.learned.message_passing.linear import Linear
from surfsup.learned.message_passing.mlp import Mlp
from surfsup.learned.message_passing.native_layers import apply_to_edges, native_precision


class MessagePassingStep(nn.Module):
    """One step of the processor: messages on the edges, then an update of the nodes by their sums."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.edge_mlp = Mlp(3 * width, width)
        self.node_mlp = Mlp(2 * width, width)

    def forward(self, nodes: Tensor, edges: Tensor, graph: EdgeGraph, update_edges: bool) -> tuple[Tensor, Tensor]:
        """Nodes (N, width) and edges (E, width) -> updated nodes and, if ``update_edges``, updated edges."""
        endpoints, edge_weight = self.first_edge_layer(nodes, edges.dtype)
        messages = self.edge_mlp.from_first_hidden(FirstEdgeLayer.apply(endpoints, edges, edge_weight, graph))
        received = SumMessages.apply(messages, graph)
        update = self.node_mlp(torch.cat([nodes.to(received.dtype), received], dim=-1))
        return nodes + update.to(nodes.dtype), edges + messages if update_edges else edges

    def forward_native(
        self, nodes: Tensor, edges: Tensor, graph: EdgeGraph, update_edges: bool
    ) -> tuple[Tensor, Tensor]:
        """:meth:`forward` in C++, in the precision of the edges."""
        endpoints, _ = self.first_edge_layer(nodes, edges.dtype)
        edge_weight = self.edge_mlp.hidden_1.weight[:, : nodes.shape[1]]
        weights, epsilon = self.edge_mlp.native_weights(edge_weight, None), self.edge_mlp.norm.eps
        received, new_edges = apply_to_edges(endpoints, edges, weights, epsilon, graph, update_edges)
        update = self.node_mlp.forward_native(torch.cat([nodes, received], dim=-1), edges.dtype, edges.dtype)
        return nodes + update, edges if new_edges is None else new_edges

    def first_edge_layer(self, nodes: Tensor, precision: torch.dtype) -> tuple[Tensor, Tensor]:
        """The first layer on edge, sender and receiver, in ``precision``.

        Returns:
            What the nodes add as sender and as receiver (N, 2 width), and the weight (width, width) for the edges.
        """
        layer = self.edge_mlp.hidden_1
        weight, bias = layer.weight.to(precision), layer.bias.to(precision)
        edge_weight, sender_weight, receiver_weight = weight.split(nodes.shape[1], dim=1)
        # Each edge has one sender, so the sender's part carries the bias.
        biases = torch.cat([bias, torch.zeros_like(bias)])
        endpoints = Linear.apply(nodes.to(precision), torch.cat([sender_weight, receiver_weight]), biases)
        return endpoints, edge_weight


class MessagePassingNetwork(nn.Module):
    """Encoder, a processor of ``layers`` steps, decoder.

    Under ``torch.autocast`` the edges and the matrix products use its precision. Features, the latent vectors of the
    nodes and the decoder stay in full precision: rounding a velocity would hide its change.
    """

    def __init__(self, inputs: int, outputs: int, width: int, layers: int) -> None:
        super().__init__()
        self.width = width
        self.node_encoder = Mlp(inputs, width)
        self.edge_encoder = Mlp(EDGE_FEATURES, width)
        self.processor = nn.ModuleList(MessagePassingStep(width) for _ in range(layers))
        self.decoder = nn.Sequential(
            nn.Linear(width, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, outputs)
        )

    def steps(self) -> list[MessagePassingStep]:
        """The steps of the processor."""
        return cast(list[MessagePassingStep], list(self.processor))

    def forward(self, node_features: Tensor, graph: EdgeGraph) -> Tensor:
        """Node features (N, inputs) and the graph with its edge features -> (N, outputs)."""
        device, precision = node_features.device.type, node_features.dtype
        if torch.is_autocast_enabled(device):
            precision = torch.get_autocast_dtype(device)
        kernels = native_precision(node_features, self.width, precision)
        with torch.autocast(device, enabled=False):
            if kernels is None:
                nodes = self.node_encoder(node_features)
                edges = self.edge_encoder(graph.edge_features, precision)
            else:
                nodes = self.node_encoder.forward_native(node_features, torch.float32, torch.float32)
                edges = self.edge_encoder.forward_native(graph.edge_features, torch.float32, kernels, kernels)
            for number, step in enumerate(self.steps(), start=1):
                run = step.forward if kernels is None else step.forward_native
                nodes, edges = run(nodes, edges, graph, number < len(self.processor))
            return self.decoder(nodes)
