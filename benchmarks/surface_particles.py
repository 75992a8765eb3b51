"""What a surface costs as particles and as a distance: GNS with 2,000 to 10,000 of them against surfsup, in one run.

    python benchmarks/surface_particles.py [--size small paper] [--particles 2000 5000 10000] [--threads 1]

Milliseconds of one frame in the middle of the splash, on a primitive, a chair of boxes, one of the shipped neural
chairs and the furnished room: `seeing` is what comes before the network (neighbors, features, and with surfsup the
distance of the solid), `frame` is all. The guard is off, for the paper has none. The weights are random: they decide
nothing here. The frame is the reference solver's, and all take turns on it, so that whatever else the machine does hits
all alike; with one thread it is processor time. The supplement (2.3.1) tells of 37 % on primitives and 13 % on chairs,
of a neural distance, on a GPU.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from surfsup.datasets.generation.scene_sampler import Drawing
from surfsup.datasets.recipes.chairs import FIT, WIDEST
from surfsup.datasets.recipes.placement import box_corners, stand
from surfsup.datasets.recipes.water import block_above
from surfsup.learned.message_passing.architecture import SIZES, MessagePassingArchitecture
from surfsup.learned.message_passing.gns import Gns, GnsArchitecture
from surfsup.learned.message_passing.history import HISTORY_LENGTH, History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.message_passing.surfsup import Surfsup
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import DeepSdfShape
from surfsup.sph.state import Environment
from surfsup.splishsplash import solver

SEED = 3
ROOM = 1  # of the complex scenes, which take turns
FRAME = 110  # the water has struck and spreads


def neural_chair() -> Scene:
    """A shipped neural chair of the size of the recipe's chairs, water above it as the recipe puts it."""
    container = Container()
    solid = Shape(deepsdf=DeepSdfShape(file=Path("chairs"), shape="chair-0100", fit=FIT))
    random = np.random.default_rng(SEED)
    solid, top = stand(solid, box_corners(solid.surface()), WIDEST, container, random)
    return Scene(container=container, surface=solid, fluid=block_above(top[:2], top[2], container, random))


SCENES: dict[str, Callable[[], Scene]] = {
    "primitive": lambda: Drawing("prim-shapes", SEED).scene(0),
    "chair": lambda: Drawing("chairs", SEED).scene(0),
    "neural-chair": neural_chair,
    "room": lambda: Drawing("complex-scenes", SEED).scene(ROOM),
}


@dataclass
class Timed:
    """A simulator, the size of its graph, and its best times so far, milliseconds."""

    name: str
    simulator: MessagePassingSimulator
    nodes: int = 0
    edges: int = 0
    seeing: float = float("inf")
    frame: float = float("inf")


def main() -> None:
    """Print a table for each scene and size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", choices=list(SCENES), nargs="+", default=list(SCENES))
    parser.add_argument("--size", choices=list(SIZES), nargs="+", default=list(SIZES))
    parser.add_argument("--particles", type=int, nargs="+", default=[2000, 5000, 10_000])
    parser.add_argument("--radius", type=float, default=MessagePassingArchitecture.radius)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    clock = time.process_time if arguments.threads == 1 else time.perf_counter
    for scene in arguments.scene:
        state, environment = splash(SCENES[scene]())
        for size in arguments.size:
            contest = simulators({**SIZES[size], "radius": arguments.radius}, arguments.particles)
            take_turns(contest, state, environment, arguments.repeats, clock)
            print(f"\n{scene}, {size}: {len(state.positions)} particles of water, {arguments.threads} threads")
            print(f"{'':<12}{'nodes':>8}{'edges':>10}{'seeing, ms':>12}{'frame, ms':>11}{'of surfsup':>12}")
            for one in contest:
                ratio = one.frame / contest[0].frame
                numbers = f"{one.nodes:>8}{one.edges:>10}{one.seeing:>12.1f}{one.frame:>11.1f}{ratio:>12.2f}"
                print(f"{one.name:<12}{numbers}", flush=True)


def splash(scene: Scene) -> tuple[History, Environment]:
    """The reference solver's water in the middle of a scene, and what is around it."""
    scene = scene.with_frames(FRAME + 1)
    surface = scene.build_surface()
    frames = solver.simulate(scene, surface, scene.initial_particles(surface))
    last = list(islice(frames, FRAME - HISTORY_LENGTH, FRAME + 1))
    positions = torch.from_numpy(np.stack([positions for positions, _ in last]))
    return History.from_frames(positions, torch.from_numpy(last[-1][1])), Environment.of(scene, surface)


def simulators(sizes: dict, counts: list[int]) -> list[Timed]:
    """surfsup, then GNS with so many surface particles each."""
    torch.manual_seed(0)
    made = [Timed("surfsup", Surfsup(MessagePassingArchitecture(**sizes)))]
    return made + [Timed(f"gns {n}", Gns(GnsArchitecture(**sizes, surface_particles=n))) for n in counts]


@torch.no_grad()
def take_turns(
    contest: list[Timed], state: History, environment: Environment, repeats: int, clock: Callable[[], float]
) -> None:
    """Fill in sizes and best times."""
    for one in contest:  # the surface's particles are drawn at first sight, once a scene
        seen = one.simulator.network_input(state, environment)
        one.nodes, one.edges = len(seen.node_features), len(seen.graph.neighbors.senders)
    for _ in range(repeats):
        for one in contest:
            start = clock()
            one.simulator.network_input(state, environment)
            between = clock()
            one.simulator.step(state, environment, handle_collisions=False)
            one.seeing = min(one.seeing, 1e3 * (between - start))
            one.frame = min(one.frame, 1e3 * (clock() - between))


if __name__ == "__main__":
    main()
