"""The continuous convolution of Ummenhofer et al. (2020) in Open3D for ``benchmarks/alternatives.py``: a whole step."""

import os
import sys
from pathlib import Path

import numpy as np
import open3d
import torch
from timing import report

sys.path.insert(0, str(Path(os.environ["PYTHONPATH"]) / "models"))
from default_torch import MyParticleNetwork

torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
given = {name: torch.from_numpy(values) for name, values in np.load(sys.argv[1]).items()}
network = MyParticleNetwork(particle_radius=float(given["particle_radius"]), gravity=(0, 0, -9.81))
state = (given["positions"], given["velocities"], None, given["solid"], given["solid_normals"])


@torch.no_grad()
def forward() -> None:
    """A step: gravity, neighbors, network, new positions and velocities."""
    network(state)


def both() -> None:
    """A step with all gradients."""
    network.zero_grad()
    network(state)[0].square().mean().backward()


report(forward, both, f"Open3D {open3d.__version__}, torch {torch.__version__}")
