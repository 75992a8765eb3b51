"""Time of the paper's network beside the same network of other projects, each in its own environment, in one run.

    python benchmarks/peers.py --lagrangebench PYTHON FOLDER --geoelements PYTHON FOLDER [--threads 1]

PYTHON is the interpreter of an environment with the packages of the peer, FOLDER the peer's source:

    LagrangeBench   github.com/tumaer/lagrangebench; jax, dm-haiku, jraph, e3nn-jax, jmp
    geoelements     github.com/geoelements/gns; torch, torch_geometric

All get the same graph and features and do ten steps of message passing with 128 channels and perceptrons of two hidden
layers in float32: forward, and forward with all gradients of the weights. Neighbor search and features are excluded.
Each runs in a process of its own with `--threads` cores, one after the other, in several rounds. The table shows the
best processor time (all threads) and the best wall time.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).parent))
from paper_network import INPUTS, water

NETWORKS = Path(__file__).parent / "peer_networks"
COLUMNS = ("forward_cpu", "forward_wall", "both_cpu", "both_wall")


def main() -> None:
    """Print one line for each network."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for peer in ("lagrangebench", "geoelements"):
        parser.add_argument(f"--{peer}", nargs=2, metavar=("PYTHON", "FOLDER"))
    parser.add_argument("--particles", type=int, default=2700)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    interpreters = {"ours": [sys.executable, "."]}
    interpreters |= {p: given for p in ("lagrangebench", "geoelements") if (given := getattr(arguments, p))}
    with tempfile.TemporaryDirectory() as folder:
        graph = Path(folder) / "graph.npz"
        edges = write_graph(graph, arguments.particles)
        print(f"{arguments.particles} particles, {edges / arguments.particles:.1f} neighbors, ", end="")
        print(f"{arguments.threads} cores; best of {arguments.rounds} x {arguments.repeats}, milliseconds", flush=True)
        best: dict[str, dict] = {}
        for _ in range(arguments.rounds):
            for name, (python, source) in interpreters.items():
                found = run(name, python, source, graph, arguments.threads, arguments.repeats)
                print(f"  {name}: " + ", ".join(f"{key} {found[key]:.0f}" for key in COLUMNS), flush=True)
                before = best.setdefault(name, found)
                best[name] = found | {key: min(found[key], before[key]) for key in COLUMNS}
    print(f"{'':<15}{'forward: cpu':>13}{'wall':>8}{'both: cpu':>12}{'wall':>8}{'of ours':>9}  versions")
    for name, found in best.items():
        a, b, c, d = (found[key] for key in COLUMNS)
        ratio = c / best["ours"]["both_cpu"]
        print(f"{name:<15}{a:>13.0f}{b:>8.0f}{c:>12.0f}{d:>8.0f}{ratio:>9.2f}  {found['versions']}")


def write_graph(path: Path, particles: int) -> int:
    """Write the features and the graph of a block of water for all to read; returns its number of edges."""
    torch.manual_seed(0)
    graph = water(particles, "cpu")
    near = graph.neighbors
    np.savez(
        path,
        nodes=torch.randn(particles, INPUTS).numpy(),
        edges=graph.edge_features.numpy(),
        senders=near.senders.numpy(),
        receivers=near.receivers.numpy(),
        starts=near.starts.numpy(),
    )
    return len(near.senders)


def run(name: str, python: str, source: str, given: Path, threads: int, repeats: int, *arguments: str) -> dict:
    """Times and versions that a script of `peer_networks` reports, in a process of its own."""
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads), "PYTHONPATH": source, "JAX_PLATFORMS": "cpu"}
    cores = sorted(os.sched_getaffinity(0))[:threads]
    command = [python, str(NETWORKS / f"{name}.py"), str(given), str(repeats), *arguments]
    done = subprocess.run(
        command,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: os.sched_setaffinity(0, cores),
    )
    if done.returncode:
        sys.exit(f"{name}: {(done.stderr.strip().splitlines() or ['ended without a word'])[-1]}")
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main()
