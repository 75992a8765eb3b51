"""Time of a step of the alternatives a user has, in one run on the same cores and the same splash.

    python benchmarks/alternatives.py [--open3d PYTHON FOLDER] [--lagrangebench PYTHON FOLDER]
        [--geoelements PYTHON FOLDER] [--threads 1]

The splash is a frame of 3,000 particles after they hit a ball. SPlisHSPlasH simulates the whole scene
(`against_solver.py`). PYTHON is the interpreter of an environment with the packages of the peer, FOLDER its source:

    Open3D          github.com/isl-org/DeepLagrangianFluids; open3d, torch: the model of Ummenhofer et al. (2020) with
                    our particle radius; the ball is 2,000 particles, without container
    LagrangeBench   github.com/tumaer/lagrangebench; jax, dm-haiku, jraph, e3nn-jax, jmp: its GNS, network alone
    geoelements     github.com/geoelements/gns; torch, torch_geometric: its GNS, network alone

Each runs in a process of its own, one after the other, in several rounds. The table shows the best time of a step,
forward and with gradients, the time that a step simulates, and the computing time for a second of water. The result is
written to `benchmarks/results/speed_networks.json` if LagrangeBench takes part.
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
from against_solver import ADAPTIVE, FIXED, run_in_own_process, scene_of
from paper_network import INPUTS
from peers import run
from record import write_result
from surfsup.learned.message_passing.architecture import SIZES, MessagePassingArchitecture
from surfsup.learned.message_passing.graph import build_graph
from surfsup.learned.message_passing.surface_particles import poisson_disk
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Scene
from surfsup.simulation import Simulation
from surfsup.sph.neighbor_search import find_neighbors

SURFACE_PARTICLES = 2000
FRAME = 110  # the water has hit the ball and spreads
SCRIPTS = {"open3d": "continuous_convolution"}  # a script must not have the name of a module that it imports
OPEN3D_STEP = 0.02  # seconds, as its authors trained it
PEERS = ("open3d", "lagrangebench", "geoelements")


@dataclass
class Alternative:
    """A way to move the water, and its best times so far in milliseconds.

    Attributes:
        script: in `peer_networks`, that times it.
        python, source: its environment and what that imports.
        arguments: of the script, after the splash and the repeats.
        step: seconds that one step simulates.
        versions: of its libraries.
    """

    name: str
    script: str
    python: str = sys.executable
    source: str = "."
    arguments: list[str] = field(default_factory=list)
    step: float = FRAME_TIME
    versions: str = ""
    times: dict[str, float] = field(default_factory=dict)

    def time_once(self, splash: Path, threads: int, repeats: int) -> None:
        """Time it once more."""
        found = run(self.script, self.python, self.source, splash, threads, repeats, *self.arguments)
        self.versions = self.versions or found["versions"]
        for key in ("forward_wall", "both_wall"):
            self.times[key] = min(found[key], self.times.get(key, float("inf")))


def alternatives(given: argparse.Namespace) -> list[Alternative]:
    """The simulators of surfsup, then the peers whose environments were given."""
    ours = [Alternative(DEFAULT_SIMULATOR, "frame", arguments=["default", "{}"])]
    for kind, more in (("surfsup", {}), ("gns", {"surface_particles": SURFACE_PARTICLES})):
        for size, sizes in SIZES.items():
            ours.append(Alternative(f"{kind}, {size}", "frame", arguments=[kind, json.dumps({**sizes, **more})]))
    peers = [(name, getattr(given, name)) for name in PEERS if getattr(given, name)]
    steps = {"open3d": OPEN3D_STEP}
    return ours + [
        Alternative(name, SCRIPTS.get(name, name), *where, step=steps.get(name, FRAME_TIME)) for name, where in peers
    ]


def write_splash(path: Path, scene: Scene) -> None:
    """Write the splash in the form that all scripts read."""
    surface = scene.build_surface()
    splash = next(islice(Simulation(scene, device="cpu").run(), FRAME, None))
    positions, velocities = splash.positions, splash.velocities
    radius = MessagePassingArchitecture.radius
    graph = build_graph(torch.from_numpy(positions), find_neighbors(torch.from_numpy(positions), radius), radius)
    solid = torch.from_numpy(poisson_disk(surface, SURFACE_PARTICLES, 0))
    near = graph.neighbors
    path.with_suffix(".yaml").write_text(scene.to_yaml())
    np.savez(
        path,
        positions=positions,
        velocities=velocities,
        particle_radius=np.float32(PARTICLE_RADIUS),
        solid=solid.numpy(),
        solid_normals=surface.distance_and_normal(solid)[1].numpy(),
        nodes=torch.randn(len(positions), INPUTS).numpy(),
        edges=graph.edge_features.numpy(),
        senders=near.senders.numpy(),
        receivers=near.receivers.numpy(),
        starts=near.starts.numpy(),
    )
    print(f"{len(positions)} particles, {len(near.senders) / len(positions):.1f} neighbors within {radius} m")


def main() -> None:
    """Print the table, write the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for peer in PEERS:
        parser.add_argument(f"--{peer}", nargs=2, metavar=("PYTHON", "FOLDER"))
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    scene = scene_of(given.particles, 200)
    competitors = alternatives(given)
    with tempfile.TemporaryDirectory() as folder:
        splash = Path(folder) / "splash.npz"
        write_splash(splash, scene)
        for _ in range(given.rounds):
            for one in competitors:
                one.time_once(splash, given.threads, given.repeats)
    print(f"{given.threads} threads; best of {given.rounds} x {given.repeats}, wall milliseconds")
    print("| | a step, ms | with gradients, ms | step, ms of water | s of computing for a second of water | versions |")
    print("|---|---|---|---|---|---|")
    seconds: dict[str, float] = {}
    for name in (FIXED, ADAPTIVE):
        wall, _ = run_in_own_process(name, scene, given.threads, DEFAULT_SIMULATOR)
        second = seconds[name] = wall / FRAME_TIME / 1e3
        print(f"| {name} | {wall:.1f} a frame | – | {1e3 * FRAME_TIME:.0f} | {second:.2f} | the whole scene |")
    for one in competitors:
        forward, both = one.times["forward_wall"], one.times["both_wall"]
        second = seconds[one.name] = forward / one.step / 1e3
        print(f"| {one.name} | {forward:.1f} | {both:.1f} | {1e3 * one.step:.0f} | {second:.2f} | {one.versions} |")
    if "lagrangebench" in seconds:
        write_result(
            "speed_networks",
            f"Computing time for a second of water, {given.particles:,} particles, {given.threads} thread(s)",
            round(seconds[DEFAULT_SIMULATOR], 2),
            "s",
            "GNS of LagrangeBench, 10×128, network alone",
            round(seconds["lagrangebench"], 1),
            "python benchmarks/alternatives.py --lagrangebench PYTHON FOLDER",
            values={
                "seconds_a_simulated_second": seconds,
                "ms_a_step": {one.name: one.times["forward_wall"] for one in competitors},
                "ms_a_step_with_gradients": {one.name: one.times["both_wall"] for one in competitors},
                "versions": {one.name: one.versions for one in competitors},
            },
            threads=given.threads,
        )


if __name__ == "__main__":
    main()
