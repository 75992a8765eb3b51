"""Time of the paper's network: this implementation against a plain one of the same function, in one run.

    python benchmarks/paper_network.py [--size paper] [--particles 2700] [--threads 2] [--device cpu]

The limit beside each time is the number of operations with the first edge layer split, divided by the speed of the
network's most frequent matrix product on this machine. The plain implementation does half as many operations again.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import torch

from surfsup.learned.message_passing.architecture import SIZES
from surfsup.learned.message_passing.graph import EdgeGraph, build_graph
from surfsup.learned.message_passing.linear import linear
from surfsup.learned.message_passing.network import MessagePassingNetwork
from surfsup.sph.neighbor_search import find_neighbors

sys.path.insert(0, str(Path(__file__).parent.parent))
from tests.learned.message_passing.plain import plain_network

RADIUS, INPUTS, OUTPUTS = 0.045, 22, 3
SPACING = 0.033  # of a jittered lattice that has nine neighbors within the radius
BOTH_WAYS = 3  # cost of forward and backward pass in forward passes; the backward pass has two products for each


def main() -> None:
    """Print one line for each precision and implementation."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", choices=list(SIZES), default="paper")
    parser.add_argument("--particles", type=int, default=2700)
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--repeats", type=int, default=20)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    torch.manual_seed(0)
    size = SIZES[arguments.size]
    network = MessagePassingNetwork(INPUTS, OUTPUTS, **size).to(arguments.device)
    graph = water(arguments.particles, arguments.device)
    features = torch.randn(arguments.particles, INPUTS, device=arguments.device)
    edges = len(graph.neighbors.senders)
    operations = operations_of(size["width"], size["layers"], arguments.particles, edges)
    print(
        f"{arguments.size}, {arguments.particles} particles, {edges / arguments.particles:.1f} neighbors, "
        f"{operations / 1e9:.1f} GFLOP forward, {arguments.device}, {arguments.threads} threads; best of "
        f"{arguments.repeats}, milliseconds"
    )
    print(f"{'':22}{'forward':>9}{'limit':>8}{'both':>9}{'limit':>8}{'GFLOP/s':>9}")
    for name, precision in (("float32", torch.float32), ("bfloat16", torch.bfloat16)):
        speed = product_speed(edges, size["width"], precision, arguments.device)
        limit = operations / speed * 1e3
        # The implementations alternate, so that a disturbance of the machine hits both.
        best = [[float("inf")] * 2 for _ in range(2)]
        for _ in range(arguments.repeats):
            for row, implementation in enumerate((plain_network, MessagePassingNetwork.__call__)):
                for column, run in enumerate((forward, forward_and_backward)):
                    job = partial(run, implementation, network, features, graph, precision)
                    took = milliseconds(job, features)
                    best[row][column] = min(best[row][column], took)
        for label, (one_way, both) in zip(("plain", "ours"), best, strict=True):
            times_and_limits = f"{one_way:9.1f}{limit:8.1f}{both:9.1f}{BOTH_WAYS * limit:8.1f}"
            print(f"{name + ' ' + label:22}{times_and_limits}{speed / 1e9:9.0f}", flush=True)


def water(particles: int, device: str) -> EdgeGraph:
    """The graph of a block of disordered water."""
    side = round(particles ** (1 / 3) + 0.5)
    places = torch.cartesian_prod(*[torch.arange(side) * SPACING] * 3)[:particles]
    places = (places + 0.2 * SPACING * torch.randn(places.shape)).to(device)
    return build_graph(places, find_neighbors(places, RADIUS), RADIUS)


def operations_of(width: int, layers: int, particles: int, edges: int) -> float:
    """Floating-point operations of a forward pass, those of the products alone."""
    an_edge, a_particle = 3 * width**2, (2 + 2 + 2) * width**2  # a particle: its ends, the sum and itself, two layers
    encoders = edges * (4 + 2 * width) * width + particles * (INPUTS + 2 * width) * width
    decoder = particles * (2 * width + OUTPUTS) * width
    return 2.0 * (layers * (edges * an_edge + particles * a_particle) + encoders + decoder)


def product_speed(edges: int, width: int, precision: torch.dtype, device: str) -> float:
    """Floating-point operations a second of the network's commonest product."""
    rows = torch.randn(edges, width, device=device).to(precision)
    weight = torch.randn(width, width, device=device).to(precision)
    took = min(milliseconds(lambda: linear(rows, weight), rows) for _ in range(50))
    return 2.0 * edges * width**2 / took * 1e3


def forward(run: Callable, network: MessagePassingNetwork, features: torch.Tensor, *rest: object) -> None:
    """A pass without gradients."""
    graph, precision = rest
    with torch.no_grad(), torch.autocast(features.device.type, precision, enabled=precision != torch.float32):
        run(network, features, graph)


def forward_and_backward(run: Callable, network: MessagePassingNetwork, features: torch.Tensor, *rest: object) -> None:
    """A pass with all gradients of the weights."""
    graph, precision = rest
    network.zero_grad()
    with torch.autocast(features.device.type, precision, enabled=precision != torch.float32):
        out = run(network, features, graph)
    out.float().square().mean().backward()


def milliseconds(job: Callable[[], object], on: torch.Tensor) -> float:
    """Time of ``job`` on the device of ``on``."""
    wait = torch.cuda.synchronize if on.is_cuda else lambda: None
    wait()
    start = time.perf_counter()
    job()
    wait()
    return (time.perf_counter() - start) * 1e3


if __name__ == "__main__":
    main()
