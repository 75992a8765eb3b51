"""What a user would otherwise take, in one run on the same cores: milliseconds of a step of the same splash.

    python benchmarks/alternatives.py [--open3d PYTHON FOLDER] [--lagrangebench PYTHON FOLDER]
        [--geoelements PYTHON FOLDER] [--threads 1]

Some 3,000 particles that have struck a ball, as the shipped model throws them; SPlisHSPlasH simulates the whole scene
(`against_solver.py`). PYTHON is the interpreter of an environment that has what the peer needs, FOLDER its source:

    Open3D          github.com/isl-org/DeepLagrangianFluids; open3d, torch: the model of Ummenhofer et al. (2020), whose
                    particles are given our radius; the ball is 2,000 particles, the container none
    LagrangeBench   github.com/tumaer/lagrangebench; jax, dm-haiku, jraph, e3nn-jax, jmp: its GNS, network alone
    geoelements     github.com/geoelements/gns; torch, torch_geometric: its GNS, network alone

Each runs in a process of its own, turn by turn; printed is the best, forward and with gradients, then how much time a
step simulates, and what a simulated second would cost of wall time.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).parent))
from against_solver import in_its_own_process, scene_of
from paper_network import INPUTS
from peers import run
from surfsup.learned import weights_file
from surfsup.learned.message_passing.architecture import SIZES, MessagePassingArchitecture
from surfsup.learned.message_passing.graph import edge_graph
from surfsup.learned.message_passing.surface_particles import poisson_disk
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Scene
from surfsup.simulation import simulate
from surfsup.sph.neighbor_search import find_neighbors

SURFACE_PARTICLES = 2000
FRAME = 110  # the water has struck and spreads
SCRIPTS = {"open3d": "continuous_convolution"}  # a script may not be called as what it imports
OPEN3D_STEP = 0.02  # seconds, as its authors trained it
PEERS = ("open3d", "lagrangebench", "geoelements")


@dataclass
class Alternative:
    """A way to move the water, and its best times so far in milliseconds.

    Attributes:
        script: in `peer_networks`, that times it.
        python, source: its environment and what that imports.
        arguments: of the script, after the splash and the repeats.
        step: seconds that it simulates at once.
        told: what is to be said of it.
    """

    name: str
    script: str
    python: str = sys.executable
    source: str = "."
    arguments: list[str] = field(default_factory=list)
    step: float = FRAME_TIME
    told: str = ""
    times: dict[str, float] = field(default_factory=dict)

    def take_turn(self, splash: Path, threads: int, repeats: int) -> None:
        """Time it once more."""
        found = run(self.script, self.python, self.source, splash, threads, repeats, *self.arguments)
        self.told = self.told or found["versions"]
        for key in ("forward_wall", "both_wall"):
            self.times[key] = min(found[key], self.times.get(key, float("inf")))


def alternatives(given: argparse.Namespace) -> list[Alternative]:
    """Ours, then the peers whose environments were given."""
    ours = [Alternative("surfsup, the default", "frame", arguments=["shipped", "{}"])]
    for kind, more in (("surfsup", {}), ("gns", {"surface_particles": SURFACE_PARTICLES})):
        for size, sizes in SIZES.items():
            ours.append(Alternative(f"{kind}, {size}", "frame", arguments=[kind, json.dumps({**sizes, **more})]))
    peers = [(name, getattr(given, name)) for name in PEERS if getattr(given, name)]
    steps = {"open3d": OPEN3D_STEP}
    return ours + [
        Alternative(name, SCRIPTS.get(name, name), *where, step=steps.get(name, FRAME_TIME)) for name, where in peers
    ]


def write_splash(path: Path, scene: Scene) -> None:
    """The splash as all of them take it."""
    surface = scene.build_surface()
    model, _ = weights_file.load(weights_file.find(weights_file.DEFAULT_MODEL))
    frames = simulate(model, scene, surface, scene.start(surface), "cpu")
    positions, velocities = next(islice(frames, FRAME, None))
    radius = MessagePassingArchitecture.radius
    graph = edge_graph(torch.from_numpy(positions), find_neighbors(torch.from_numpy(positions), radius), radius)
    solid = torch.from_numpy(poisson_disk(surface, SURFACE_PARTICLES, 0))
    near = graph.neighborhood
    path.with_suffix(".yaml").write_text(scene.to_yaml())
    np.savez(
        path,
        positions=positions,
        velocities=velocities,
        particle_radius=np.float32(PARTICLE_RADIUS),
        solid=solid.numpy(),
        solid_normals=surface.distance_and_normal(solid)[1].numpy(),
        nodes=torch.randn(len(positions), INPUTS).numpy(),
        edges=graph.features.numpy(),
        senders=near.senders.numpy(),
        receivers=near.receivers.numpy(),
        starts=near.starts.numpy(),
    )
    print(f"{len(positions)} particles, {len(near.senders) / len(positions):.1f} neighbors within {radius} m")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for peer in PEERS:
        parser.add_argument(f"--{peer}", nargs=2, metavar=("PYTHON", "FOLDER"))
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    scene = scene_of(given.particles, 200)
    contest = alternatives(given)
    with tempfile.TemporaryDirectory() as folder:
        splash = Path(folder) / "splash.npz"
        write_splash(splash, scene)
        for _ in range(given.rounds):
            for one in contest:
                one.take_turn(splash, given.threads, given.repeats)
    print(f"{given.threads} threads; best of {given.rounds} x {given.repeats}, wall milliseconds")
    print("| | a step, ms | with gradients, ms | step, ms of water | s of computing a simulated second | versions |")
    print("|---|---|---|---|---|---|")
    for name in ("solver 1 ms", "solver CFL"):
        wall, _ = in_its_own_process(name, scene, given.threads, None)
        second = wall / FRAME_TIME / 1e3
        print(f"| {name} | {wall:.1f} a frame | – | {1e3 * FRAME_TIME:.0f} | {second:.2f} | the whole scene |")
    for one in contest:
        forward, both = one.times["forward_wall"], one.times["both_wall"]
        second = forward / one.step / 1e3
        print(f"| {one.name} | {forward:.1f} | {both:.1f} | {1e3 * one.step:.0f} | {second:.2f} | {one.told} |")


if __name__ == "__main__":
    main()
