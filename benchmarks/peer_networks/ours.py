"""The network of surfsup for ``benchmarks/peers.py``."""

import os
import sys

import numpy as np
import torch
from timing import report

from surfsup.learned.message_passing.architecture import SIZES
from surfsup.learned.message_passing.graph import EdgeGraph
from surfsup.learned.message_passing.network import MessagePassingNetwork
from surfsup.sph.neighbor_search import NeighborList

torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
given = {name: torch.from_numpy(values) for name, values in np.load(sys.argv[1]).items()}
graph = EdgeGraph(NeighborList(given["starts"], given["receivers"], given["senders"]), given["edges"])
network = MessagePassingNetwork(given["nodes"].shape[1], 3, **SIZES["paper"])


@torch.no_grad()
def forward() -> None:
    """A pass without gradients."""
    network(given["nodes"], graph)


def both() -> None:
    """A pass with all gradients."""
    network.zero_grad()
    network(given["nodes"], graph).square().mean().backward()


report(forward, both, f"torch {torch.__version__}")
