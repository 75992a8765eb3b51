"""Cost of a surface as particles and as a distance: GNS with 2,000 to 10,000 particles against surfsup, in one run.

    python benchmarks/surface_particles.py [--size small paper] [--particles 2000 5000 10000] [--threads 1]

Milliseconds of one frame in the middle of the splash, on a primitive, a chair of boxes, a shipped neural chair and the
furnished room. `features` is the time before the network (neighbors, features, and for surfsup the signed distance),
`frame` is the whole. Collision handling is off, since the paper has none. The weights are random, which does not change
the time. The frame comes from SPlisHSPlasH, and the simulators alternate on it, so that a disturbance of the machine
hits all of them. With one thread the time is processor time. The supplement of the paper (2.3.1) reports 37 % on
primitives and 13 % on chairs, with a neural distance, on a GPU.
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

from surfsup.datasets.generation.scene_sampler import SceneSampler
from surfsup.datasets.recipes.chairs import FIT, MAX_WIDTH
from surfsup.datasets.recipes.placement import bounding_box_corners, place_on_floor
from surfsup.datasets.recipes.water import block_above
from surfsup.learned.message_passing.architecture import SIZES, MessagePassingArchitecture
from surfsup.learned.message_passing.gns import Gns, GnsArchitecture
from surfsup.learned.message_passing.history import HISTORY_LENGTH, History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.message_passing.surfsup import Surfsup
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import DeepSdfShape
from surfsup.sph.environment import Environment
from surfsup.splishsplash import solver

SEED = 3
ROOM = 1  # number of the room in the complex scenes
FRAME = 110  # the water has hit the solid and spreads


def neural_chair() -> Scene:
    """A shipped neural chair of the size of the recipe's chairs, water above it as the recipe puts it."""
    container = Container()
    solid = Shape(deepsdf=DeepSdfShape(file=Path("chairs"), shape="chair-0100", fit=FIT))
    random = np.random.default_rng(SEED)
    solid, top = place_on_floor(solid, bounding_box_corners(solid.surface()), MAX_WIDTH, container, random)
    return Scene(container=container, surface=solid, fluid=[block_above(top[:2], top[2], container, random)])


SCENES: dict[str, Callable[[], Scene]] = {
    "primitive": lambda: SceneSampler("prim-shapes", SEED).scene(0),
    "chair": lambda: SceneSampler("chairs", SEED).scene(0),
    "neural-chair": neural_chair,
    "room": lambda: SceneSampler("complex-scenes", SEED).scene(ROOM),
}


@dataclass
class Timed:
    """A simulator, the size of its graph, and its best times so far, milliseconds."""

    name: str
    simulator: MessagePassingSimulator
    nodes: int = 0
    edges: int = 0
    features: float = float("inf")
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
            competitors = simulators({**SIZES[size], "radius": arguments.radius}, arguments.particles)
            alternate(competitors, state, environment, arguments.repeats, clock)
            print(f"\n{scene}, {size}: {len(state.positions)} particles of water, {arguments.threads} threads")
            print(f"{'':<12}{'nodes':>8}{'edges':>10}{'features, ms':>13}{'frame, ms':>11}{'of surfsup':>12}")
            for one in competitors:
                ratio = one.frame / competitors[0].frame
                numbers = f"{one.nodes:>8}{one.edges:>10}{one.features:>13.1f}{one.frame:>11.1f}{ratio:>12.2f}"
                print(f"{one.name:<12}{numbers}", flush=True)


def splash(scene: Scene) -> tuple[History, Environment]:
    """The frame of SPlisHSPlasH in the middle of a scene, and its environment."""
    scene = scene.with_frames(FRAME + 1)
    surface = scene.build_surface()
    frames = solver.simulate(scene, surface, scene.initial_particles(surface))
    last = list(islice(frames, FRAME - HISTORY_LENGTH, FRAME + 1))
    positions = torch.from_numpy(np.stack([positions for positions, _ in last]))
    return History.from_frames(positions, torch.from_numpy(last[-1][1])), Environment.of(scene, surface)


def simulators(sizes: dict, counts: list[int]) -> list[Timed]:
    """surfsup, then GNS with each number of surface particles."""
    torch.manual_seed(0)
    found = [Timed("surfsup", Surfsup(MessagePassingArchitecture(**sizes)))]
    return found + [Timed(f"gns {n}", Gns(GnsArchitecture(**sizes, surface_particles=n))) for n in counts]


@torch.no_grad()
def alternate(
    competitors: list[Timed], state: History, environment: Environment, repeats: int, clock: Callable[[], float]
) -> None:
    """Fill in sizes and best times."""
    for one in competitors:  # the first call samples the surface particles, once a scene
        given = one.simulator.network_input(state, environment)
        one.nodes, one.edges = len(given.node_features), len(given.graph.neighbors.senders)
    for _ in range(repeats):
        for one in competitors:
            start = clock()
            one.simulator.network_input(state, environment)
            between = clock()
            one.simulator.step(state, environment, handle_collisions=False)
            one.features = min(one.features, 1e3 * (between - start))
            one.frame = min(one.frame, 1e3 * (clock() - between))


if __name__ == "__main__":
    main()
