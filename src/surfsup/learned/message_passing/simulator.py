"""The base of all message-passing simulators: from the last moves of the particles to their next one."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import torch
from torch import Tensor

from surfsup.learned.message_passing.architecture import MessagePassingArchitecture
from surfsup.learned.message_passing.graph import EdgeGraph, edge_graph, join_graphs
from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.network import MessagePassingNetwork
from surfsup.learned.message_passing.noise import random_walk
from surfsup.learned.message_passing.normal import Moments, Normal
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import FRAME_TIME, Environment

MOVE_SPREAD = (1.9e-3, 1.9e-3, 4.1e-3)  # meters a frame, measured; data of other scenes are measured anew
ACCELERATION_SPREAD = (3e-4, 3e-4, 3e-4)  # meters a frame², measured
WALLS = 6


@dataclass(frozen=True)
class NodesAndEdges:
    """One state as the network sees it.

    Attributes:
        features: (M, F) of all nodes.
        graph: their edges.
        fluid: (N,) which nodes are fluid, in the order of the state's particles.
    """

    features: Tensor
    graph: EdgeGraph
    fluid: Tensor


class MessagePassingSimulator(Simulator[History]):
    """A graph network on particles whose history is known as moves alone, stepped by semi-implicit Euler.

    The network is told of each particle its last moves, the distances to the container's walls and what a subclass
    adds, of the surface above all; it predicts the next acceleration (supplement, section 6). Time is counted in
    steps: a move is meters a step, an acceleration meters a step².
    """

    architecture_type: ClassVar[type] = MessagePassingArchitecture
    outputs: ClassVar[int] = 3
    extra_features: ClassVar[int]

    def __init__(self, architecture: MessagePassingArchitecture) -> None:
        super().__init__(architecture)
        stride = architecture.stride
        self.moves = Normal([stride * spread for spread in MOVE_SPREAD])
        self.accelerations = Normal([stride**2 * spread for spread in ACCELERATION_SPREAD])
        inputs = 3 * architecture.history + WALLS + self.extra_features
        self.network = MessagePassingNetwork(inputs, self.outputs, architecture.width, architecture.layers)

    @property
    def past(self) -> int:
        """Frames that the history reaches back."""
        return self.architecture.history * self.architecture.stride

    @property
    def step_time(self) -> float:
        """Seconds in a step."""
        return self.architecture.stride * FRAME_TIME

    def start(self, positions: Tensor, velocities: Tensor, environment: Environment) -> History:
        """The state of particles (N, 3) at the start of a scene."""
        sizes = self.architecture
        return History.in_free_fall(positions, velocities, environment.gravity, sizes.history, sizes.stride)

    def state_after(self, positions: Tensor, velocities: Tensor) -> History:
        """The state at the last of true frames (past + 1, N, 3)."""
        return History.of_frames(positions, velocities[-1], self.architecture.stride)

    @abstractmethod
    def see_extra(self, nodes: History, environment: Environment) -> Tensor:
        """What each node is told besides its moves and the walls, (M, extra_features)."""

    def nodes(self, state: History, environment: Environment) -> History:
        """All nodes of the graph, the fluid's particles first; here these are all."""
        return state

    def observe(self, state: History, environment: Environment) -> NodesAndEdges:
        """See ``state``: features of the nodes, and their neighbors where they are now."""
        nodes, radius = self.nodes(state, environment), self.architecture.radius
        features = torch.cat(
            [
                self.moves.normalize(nodes.moves).flatten(1),
                self.see_walls(nodes.positions, environment),
                self.see_extra(nodes, environment),
            ],
            dim=-1,
        )
        graph = edge_graph(nodes.positions, find_neighbors(nodes.positions, radius), radius)
        return NodesAndEdges(features, graph, torch.arange(len(state.positions), device=features.device))

    def see_walls(self, positions: Tensor, environment: Environment) -> Tensor:
        """Distances to the six walls (M, 6), relative to the radius and cut off beyond it, as in GNS."""
        walls = torch.cat([positions - environment.lower, environment.upper - positions], dim=-1)
        return (walls / self.architecture.radius).clamp(-1, 1)

    def predict(self, seen: NodesAndEdges) -> Tensor:
        """What the network makes of it for each fluid particle: its acceleration (N, 3), normalized."""
        return self.network(seen.features, seen.graph).index_select(0, seen.fluid)

    def wanted(self, state: History, move: Tensor, velocities: Tensor) -> Tensor:
        """What :meth:`predict` should have given for the true next step, (N, outputs).

        With a noisy state the true move is still the one from true place to true place: so the network learns to undo
        the noise of the last move, not that of the place, as in GNS.

        Args:
            state: what was seen.
            move: (N, 3), the true move of the next step, meters.
            velocities: (N, 3), the true ones at the end of the next step, m/s.
        """
        return self.accelerations.normalize(move - state.moves[:, 0])

    def advance(self, state: History, predicted: Tensor) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) and velocities (N, 3) one step later, before the guard."""
        move = state.moves[:, 0] + self.accelerations.restore(predicted[:, :3])
        return state.positions + move, move / self.step_time

    def step(self, state: History, environment: Environment, handle_collisions: bool = True) -> tuple[History, Tensor]:
        """The state one step later, and which particles (N,) the guard had to move."""
        positions, velocities = self.advance(state, self.predict(self.observe(state, environment)))
        moved = torch.zeros(len(positions), dtype=torch.bool, device=positions.device)
        if handle_collisions:
            kept = resolve_collisions(state.positions, positions, velocities, environment)
            positions, velocities, moved = kept.positions, kept.velocities, kept.moved
        return state.moved_to(positions, velocities), moved

    def between(
        self, before: History, after: History, environment: Environment, handle_collisions: bool
    ) -> Iterator[tuple[History, Tensor]]:
        """The frames that a step of several passes over, on the parabola through the last three places."""
        for frame in range(1, self.architecture.stride):
            share = frame / self.architecture.stride
            bend = share * (1 - share) / 2 * (after.moves[:, 0] - before.moves[:, 0])
            positions = before.positions + share * after.moves[:, 0] - bend
            velocities = torch.lerp(before.velocities, after.velocities, share)
            moved = torch.zeros(len(positions), dtype=torch.bool, device=positions.device)
            if handle_collisions:
                kept = resolve_collisions(before.positions, positions, velocities, environment)
                positions, velocities, moved = kept.positions, kept.velocities, kept.moved
            yield replace(after, positions=positions, velocities=velocities), moved

    def with_noise(self, state: History, size: float, generator: torch.Generator) -> History:
        """A state for training, its moves off by a random walk of ``size`` meters at the last one."""
        return random_walk(state, size, generator)[0]

    def quantities(self, state: History, move: Tensor, velocities: Tensor) -> dict[Normal, Tensor]:
        """The values (..., 3) that each normalization is of, for a state and the true step after it."""
        return {self.moves: state.moves, self.accelerations: move - state.moves[:, 0]}

    def measure(self, examples: Iterable[tuple[History, Tensor, Tensor]]) -> None:
        """Take the normalizations from examples: a state, the true next move and the velocities after it.

        States with the training's noise give GNS's statistics, which have it in them.
        """
        moments: dict[Normal, Moments] = {}
        for example in examples:
            for normal, values in self.quantities(*example).items():
                moments.setdefault(normal, Moments()).add(values)
        for normal, measured in moments.items():
            normal.take(measured)


def join_seen(parts: list[NodesAndEdges]) -> NodesAndEdges:
    """Several scenes side by side, for one pass of the network; their fluid one after the other."""
    fluid, nodes = [], 0
    for part in parts:
        fluid.append(part.fluid + nodes)
        nodes += len(part.features)
    return NodesAndEdges(
        torch.cat([part.features for part in parts]), join_graphs([part.graph for part in parts]), torch.cat(fluid)
    )
