"""The same network in plain torch: the reference for the fast one."""

import torch
from torch import Tensor
from torch.nn.functional import layer_norm, linear, relu

from surfsup.learned.message_passing.graph import EdgeGraph
from surfsup.learned.message_passing.mlp import Mlp
from surfsup.learned.message_passing.network import MessagePassingNetwork


def plain_network(network: MessagePassingNetwork, node_features: Tensor, graph: EdgeGraph) -> Tensor:
    """The outputs (N, outputs) of ``network``, by concatenation, indexing and ``index_add``."""
    senders, receivers = graph.neighbors.senders, graph.neighbors.receivers
    nodes = plain_mlp(network.node_encoder, node_features)
    edges = plain_mlp(network.edge_encoder, graph.edge_features)
    for step in network.processor:
        messages = plain_mlp(step.edge_mlp, torch.cat([edges, nodes[senders], nodes[receivers]], dim=-1))
        received = torch.zeros_like(nodes, dtype=messages.dtype).index_add(0, receivers, messages)
        nodes = nodes + plain_mlp(step.node_mlp, torch.cat([nodes, received], dim=-1))
        edges = edges + messages
    return network.decoder(nodes)


def plain_mlp(mlp: Mlp, rows: Tensor) -> Tensor:
    hidden = relu(linear(rows, mlp.hidden_1.weight, mlp.hidden_1.bias))
    hidden = relu(linear(hidden, mlp.hidden_2.weight, mlp.hidden_2.bias))
    out = linear(hidden, mlp.output.weight, mlp.output.bias)
    return layer_norm(out, out.shape[-1:], mlp.norm.weight, mlp.norm.bias)
