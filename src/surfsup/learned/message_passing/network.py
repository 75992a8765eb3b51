"""The paper's network: encoder, steps of message passing with weights of their own, decoder (supplement, section 6).

    e_ij <- e_ij + f(e_ij, v_j, v_i)          v_i <- v_i + g(v_i, sum_j f(e_ij, v_j, v_i))

As in the code of GNS (Sanchez-Gonzalez et al. 2020), particles sum the new messages alone, not the edges' states.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from surfsup.learned.message_passing.graph import EDGE_FEATURES, EdgeGraph, FirstEdgeLayer, SumOverEdges
from surfsup.learned.message_passing.perceptron import Perceptron
from surfsup.learned.message_passing.products import Linear


class MessagePassingStep(nn.Module):
    """One step: every edge makes a message of its state and its two ends, every particle takes in their sum."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.edge = Perceptron(3 * width, width)
        self.node = Perceptron(2 * width, width)

    def message(self, nodes: Tensor, edges: Tensor, graph: EdgeGraph) -> Tensor:
        """Particles (N, width) and edges (E, width) -> messages (E, width) in the precision of the edges."""
        precision, width = edges.dtype, edges.shape[1]
        weight, bias = self.edge.first.weight.to(precision), self.edge.first.bias.to(precision)
        own, sender, receiver = weight.split(width, dim=1)
        # The bias goes with the sender: an edge has one.
        both_biases = torch.cat([bias, torch.zeros_like(bias)])
        ends = Linear.apply(nodes.to(precision), torch.cat([sender, receiver]), both_biases)
        return self.edge.after_first(FirstEdgeLayer.apply(ends, edges, own, graph))

    def update(self, nodes: Tensor, messages: Tensor, graph: EdgeGraph) -> Tensor:
        """Particles (N, width) and messages (E, width) -> particles."""
        received = SumOverEdges.apply(messages, graph)
        change = self.node(torch.cat([nodes.to(received.dtype), received], dim=-1))
        return nodes + change.to(nodes.dtype)


class MessagePassingNetwork(nn.Module):
    """Encoder, ``layers`` steps, decoder.

    Under ``torch.autocast`` all that is large is done in its precision: the edges, and the products. The features, the
    particles' own state and the decoder stay in full precision: rounding a velocity would hide its change.
    """

    def __init__(self, inputs: int, outputs: int, width: int, layers: int) -> None:
        super().__init__()
        self.node_encoder = Perceptron(inputs, width)
        self.edge_encoder = Perceptron(EDGE_FEATURES, width)
        self.steps = nn.ModuleList(MessagePassingStep(width) for _ in range(layers))
        self.decoder = nn.Sequential(
            nn.Linear(width, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, outputs)
        )

    def forward(self, features: Tensor, graph: EdgeGraph) -> Tensor:
        """What is told of the particles (N, inputs) and of their edges -> (N, outputs)."""
        device, precision = features.device.type, features.dtype
        if torch.is_autocast_enabled(device):
            precision = torch.get_autocast_dtype(device)
        with torch.autocast(device, enabled=False):
            nodes = self.node_encoder(features)
            edges = self.edge_encoder(graph.features, precision)
            for number, step in enumerate(self.steps, start=1):
                messages = step.message(nodes, edges, graph)
                nodes = step.update(nodes, messages, graph)
                if number < len(self.steps):
                    edges = edges + messages
            return self.decoder(nodes)
