"""A whole frame of one of our simulators for ``benchmarks/alternatives.py``; the kind and its sizes are arguments."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import torch
from timing import tell

from surfsup.learned import weights_file
from surfsup.learned.registry import KINDS
from surfsup.scene import Scene
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import Environment

torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
kind, sizes = sys.argv[3], json.loads(sys.argv[4])


def simulator() -> Simulator:
    """The shipped model, or another kind with random weights, which decide nothing here."""
    if kind == "shipped":
        return weights_file.load(weights_file.find(weights_file.DEFAULT_MODEL))[0]
    torch.manual_seed(0)
    return KINDS[kind](KINDS[kind].architecture_type(**sizes))


given = np.load(sys.argv[1])
scene = Scene.load(Path(sys.argv[1]).with_suffix(".yaml"))
environment = Environment.of(scene, scene.build_surface())
model = simulator()
state = model.start(torch.from_numpy(given["positions"]), torch.from_numpy(given["velocities"]), environment)


@torch.no_grad()
def forward() -> None:
    """A frame: neighbors, features, distances, network, guard."""
    model.step(state, environment)


def both() -> None:
    """The same with the gradients of the weights, as far as a rollout has them."""
    model.requires_grad_().zero_grad()
    after, _ = model.step(state, environment)
    after.positions.square().mean().backward()


tell(forward, both, f"torch {torch.__version__}")
