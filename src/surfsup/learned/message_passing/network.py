"""The paper's graph network: encoder, processor, decoder (supplement, section 6).

The processor's steps have their own weights. A step computes messages on the edges and sums them at the nodes:

    m_ij = f(e_ij, v_j, v_i)        e_ij <- e_ij + m_ij        v_i <- v_i + g(v_i, sum_j m_ij)

As in the code of GNS (Sanchez-Gonzalez et al. 2020), nodes sum the messages m_ij, not the updated edges e_ij.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from surfsup.learned.message_passing.graph import EDGE_FEATURES, EdgeGraph, FirstEdgeLayer, SumMessages
from surfsup.learned.message_passing.linear import Linear
from surfsup.learned.message_passing.mlp import Mlp


class MessagePassingStep(nn.Module):
    """One step of the processor: messages on the edges, then an update of the nodes by their sums."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.edge_mlp = Mlp(3 * width, width)
        self.node_mlp = Mlp(2 * width, width)

    def forward(self, nodes: Tensor, edges: Tensor, graph: EdgeGraph) -> tuple[Tensor, Tensor]:
        """Nodes (N, width) and edges (E, width) -> updated nodes and messages (E, width)."""
        messages = self.message(nodes, edges, graph)
        received = SumMessages.apply(messages, graph)
        update = self.node_mlp(torch.cat([nodes.to(received.dtype), received], dim=-1))
        return nodes + update.to(nodes.dtype), messages

    def message(self, nodes: Tensor, edges: Tensor, graph: EdgeGraph) -> Tensor:
        """Nodes (N, width) and edges (E, width) -> messages (E, width) in the precision of the edges."""
        precision, width = edges.dtype, edges.shape[1]
        layer = self.edge_mlp.hidden_1
        weight, bias = layer.weight.to(precision), layer.bias.to(precision)
        edge_weight, sender_weight, receiver_weight = weight.split(width, dim=1)
        # Each edge has one sender, so the sender's part carries the bias.
        biases = torch.cat([bias, torch.zeros_like(bias)])
        endpoints = Linear.apply(nodes.to(precision), torch.cat([sender_weight, receiver_weight]), biases)
        return self.edge_mlp.from_first_hidden(FirstEdgeLayer.apply(endpoints, edges, edge_weight, graph))


class MessagePassingNetwork(nn.Module):
    """Encoder, a processor of ``layers`` steps, decoder.

    Under ``torch.autocast`` the edges and the matrix products use its precision. Features, the latent vectors of the
    nodes and the decoder stay in full precision: rounding a velocity would hide its change.
    """

    def __init__(self, inputs: int, outputs: int, width: int, layers: int) -> None:
        super().__init__()
        self.node_encoder = Mlp(inputs, width)
        self.edge_encoder = Mlp(EDGE_FEATURES, width)
        self.processor = nn.ModuleList(MessagePassingStep(width) for _ in range(layers))
        self.decoder = nn.Sequential(
            nn.Linear(width, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, outputs)
        )

    def forward(self, node_features: Tensor, graph: EdgeGraph) -> Tensor:
        """Node features (N, inputs) and the graph with its edge features -> (N, outputs)."""
        device, precision = node_features.device.type, node_features.dtype
        if torch.is_autocast_enabled(device):
            precision = torch.get_autocast_dtype(device)
        with torch.autocast(device, enabled=False):
            nodes = self.node_encoder(node_features)
            edges = self.edge_encoder(graph.edge_features, precision)
            for number, step in enumerate(self.processor, start=1):
                nodes, messages = step(nodes, edges, graph)
                if number < len(self.processor):
                    edges = edges + messages
            return self.decoder(nodes)
