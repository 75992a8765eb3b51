"""The same network written plainly: the reference that the fast one must equal."""

import torch
from torch import Tensor
from torch.nn.functional import layer_norm, linear, relu

from surfsup.learned.message_passing.graph import EdgeGraph
from surfsup.learned.message_passing.network import MessagePassingNetwork
from surfsup.learned.message_passing.perceptron import Perceptron


def plain_network(network: MessagePassingNetwork, features: Tensor, graph: EdgeGraph) -> Tensor:
    """The outputs (N, outputs) of ``network``, by concatenation, indexing and ``index_add``."""
    senders, receivers = graph.neighborhood.senders, graph.neighborhood.receivers
    nodes = plain_perceptron(network.node_encoder, features)
    edges = plain_perceptron(network.edge_encoder, graph.features)
    for step in network.steps:
        messages = plain_perceptron(step.edge, torch.cat([edges, nodes[senders], nodes[receivers]], dim=-1))
        received = torch.zeros_like(nodes, dtype=messages.dtype).index_add(0, receivers, messages)
        nodes = nodes + plain_perceptron(step.node, torch.cat([nodes, received], dim=-1))
        edges = edges + messages
    return network.decoder(nodes)


def plain_perceptron(perceptron: Perceptron, rows: Tensor) -> Tensor:
    hidden = relu(linear(rows, perceptron.first.weight, perceptron.first.bias))
    hidden = relu(linear(hidden, perceptron.second.weight, perceptron.second.bias))
    out = linear(hidden, perceptron.third.weight, perceptron.third.bias)
    return layer_norm(out, out.shape[-1:], perceptron.norm.weight, perceptron.norm.bias)
