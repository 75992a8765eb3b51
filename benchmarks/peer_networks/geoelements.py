"""The network of geoelements/gns (PyTorch Geometric) for ``benchmarks/peers.py``."""

import os
import sys

import numpy as np
import torch
import torch_geometric
from gns.graph_network import EncodeProcessDecode
from timing import report

torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
given = {name: torch.from_numpy(values) for name, values in np.load(sys.argv[1]).items()}
ends = torch.stack([given["senders"], given["receivers"]])
network = EncodeProcessDecode(
    nnode_in_features=given["nodes"].shape[1],
    nnode_out_features=3,
    nedge_in_features=given["edges"].shape[1],
    latent_dim=128,
    nmessage_passing_steps=10,
    nmlp_layers=2,
    mlp_hidden_dim=128,
)


@torch.no_grad()
def forward() -> None:
    """A pass without gradients."""
    network(given["nodes"], ends, given["edges"])


def both() -> None:
    """A pass with all gradients."""
    network.zero_grad()
    network(given["nodes"], ends, given["edges"]).square().mean().backward()


report(forward, both, f"torch {torch.__version__}, torch_geometric {torch_geometric.__version__}")
