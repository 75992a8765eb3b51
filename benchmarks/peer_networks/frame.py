"""A whole frame of a simulator of surfsup for ``benchmarks/alternatives.py``; name and sizes are arguments."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import torch
from timing import report

from surfsup.learned.loading import load_simulator
from surfsup.learned.registry import LEARNED_SIMULATORS
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import Scene
from surfsup.sph.environment import Environment
from surfsup.sph.simulator import Simulator

torch.set_num_threads(int(os.environ["OMP_NUM_THREADS"]))
kind, sizes = sys.argv[3], json.loads(sys.argv[4])


def simulator() -> Simulator:
    """The default simulator, or a network with random weights, which do not change the time."""
    if kind == "default":
        return load_simulator(DEFAULT_SIMULATOR)[0]
    torch.manual_seed(0)
    return LEARNED_SIMULATORS[kind](LEARNED_SIMULATORS[kind].architecture_type(**sizes))


given = np.load(sys.argv[1])
scene = Scene.load(Path(sys.argv[1]).with_suffix(".yaml"))
environment = Environment.of(scene, scene.build_surface())
chosen = simulator()
state = chosen.initial_state(torch.from_numpy(given["positions"]), torch.from_numpy(given["velocities"]), environment)


@torch.no_grad()
def forward() -> None:
    """A frame: neighbors, features, distances, network or pressure solve, collision handling."""
    chosen.step(state, environment)


def both() -> None:
    """The same with the gradients of positions and, where there are any, of weights."""
    if isinstance(chosen, torch.nn.Module):
        chosen.requires_grad_().zero_grad()
    positions = torch.from_numpy(given["positions"]).requires_grad_()
    before = chosen.initial_state(positions, torch.from_numpy(given["velocities"]), environment)
    after, _ = chosen.step(before, environment)
    after.positions.square().mean().backward()


report(forward, both, f"torch {torch.__version__}")
