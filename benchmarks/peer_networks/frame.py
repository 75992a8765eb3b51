"""A whole frame of one of our simulators for ``benchmarks/alternatives.py``; the kind and its sizes are arguments."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import torch
from timing import tell

from surfsup.model import weights
from surfsup.model.kinds import KINDS
from surfsup.model.learned_simulator import LearnedSimulator
from surfsup.model.state import Surroundings
from surfsup.scene import Scene

torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
kind, sizes = sys.argv[3], json.loads(sys.argv[4])


def simulator() -> LearnedSimulator:
    """The shipped model, or another kind with random weights, which decide nothing here."""
    if kind == "shipped":
        return weights.load(weights.find(weights.DEFAULT_MODEL))[0]
    torch.manual_seed(0)
    return KINDS[kind](KINDS[kind].architecture_type(**sizes))


given = np.load(sys.argv[1])
scene = Scene.load(Path(sys.argv[1]).with_suffix(".yaml"))
around = Surroundings.of(scene, scene.build_surface())
model = simulator()
state = model.start(torch.from_numpy(given["positions"]), torch.from_numpy(given["velocities"]), around)


@torch.no_grad()
def forward() -> None:
    """A frame: neighbours, features, distances, network, guard."""
    model.step(state, around)


def both() -> None:
    """The same with the gradients of the weights, as far as a rollout has them."""
    model.requires_grad_().zero_grad()
    after, _ = model.step(state, around)
    after.positions.square().mean().backward()


tell(forward, both, f"torch {torch.__version__}")
