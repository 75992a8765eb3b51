"""The base of all message-passing simulators: from the last displacements of the particles to the next one."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from surfsup.learned.base import LearnedSimulator
from surfsup.learned.message_passing.architecture import MessagePassingArchitecture
from surfsup.learned.message_passing.graph import EdgeGraph, batch_graphs, build_graph
from surfsup.learned.message_passing.history import HISTORY_LENGTH, History
from surfsup.learned.message_passing.network import MessagePassingNetwork
from surfsup.learned.message_passing.noise import add_random_walk
from surfsup.learned.message_passing.normalizer import Normalizer, RunningStatistics
from surfsup.scene import FRAME_TIME
from surfsup.sph.collision import resolve_collisions
from surfsup.sph.environment import Environment
from surfsup.sph.neighbor_search import find_neighbors

# Initial standard deviations, in meters a frame and meters a frame²; training replaces them by those of its data.
DISPLACEMENT_STD = (1.9e-3, 1.9e-3, 4.1e-3)
ACCELERATION_STD = (3e-4, 3e-4, 3e-4)
WALLS = 6
WALL_LIMIT = 0.18  # meters; at 5 m/s, water at this distance is seven frames from the wall


@dataclass(frozen=True)
class NetworkInput:
    """The input of the network.

    Attributes:
        node_features: (M, F) of all nodes.
        graph: the edges between them, with their features.
        fluid_nodes: (N,) int64, the nodes of the fluid's particles, in the order of the state.
    """

    node_features: Tensor
    graph: EdgeGraph
    fluid_nodes: Tensor


class MessagePassingSimulator(LearnedSimulator[History]):
    """A graph network that predicts the next acceleration, integrated by semi-implicit Euler (supplement, section 6).

    The node features are the last displacements, the distances to the container's walls, and what a subclass adds about
    the surface. Time is counted in frames: a displacement is in meters a frame, an acceleration in meters a frame².
    """

    architecture_type: ClassVar[type] = MessagePassingArchitecture
    history_length: ClassVar[int] = HISTORY_LENGTH
    surface_feature_count: ClassVar[int]
    architecture: MessagePassingArchitecture

    def __init__(self, architecture: MessagePassingArchitecture) -> None:
        super().__init__(architecture)
        self.displacement_normalizer = Normalizer(DISPLACEMENT_STD)
        self.acceleration_normalizer = Normalizer(ACCELERATION_STD)
        inputs = 3 * HISTORY_LENGTH + WALLS + self.surface_feature_count
        self.network = MessagePassingNetwork(inputs, 3, architecture.width, architecture.layers)

    def initial_state(self, positions: Tensor, velocities: Tensor, environment: Environment) -> History:
        """The state of particles (N, 3) at the start of a scene, after an assumed free fall."""
        return History.in_free_fall(positions, velocities, environment.gravity)

    def state_from_frames(self, positions: Tensor, velocities: Tensor) -> History:
        """The state at the last of consecutive frames (T + 1, N, 3)."""
        return History.from_frames(positions, velocities[-1])

    @abstractmethod
    def surface_features(self, nodes: History, environment: Environment) -> Tensor:
        """Features of each node that describe the surface, (M, surface_feature_count)."""

    def nodes(self, state: History, environment: Environment) -> History:
        """All nodes of the graph, those of the fluid first; by default only these."""
        return state

    def network_input(self, state: History, environment: Environment) -> NetworkInput:
        """Node features, edges and edge features of a state."""
        nodes, radius = self.nodes(state, environment), self.architecture.radius
        features = torch.cat(
            [
                self.displacement_normalizer.normalize(nodes.displacements).flatten(1),
                self.wall_features(nodes.positions, environment),
                self.surface_features(nodes, environment),
            ],
            dim=-1,
        )
        graph = build_graph(nodes.positions, find_neighbors(nodes.positions, radius), radius)
        return NetworkInput(features, graph, torch.arange(len(state.positions), device=features.device))

    def wall_features(self, positions: Tensor, environment: Environment) -> Tensor:
        """Distances to the six walls (M, 6) in units of WALL_LIMIT, clipped to [-1, 1]; GNS has the radius instead."""
        limit = WALL_LIMIT if self.architecture.features > 1 else self.architecture.radius
        distances = torch.cat([positions - environment.lower, environment.upper - positions], dim=-1)
        return (distances / limit).clamp(-1, 1)

    def predict_acceleration(self, inputs: NetworkInput) -> Tensor:
        """The network's normalized acceleration of each fluid particle (N, 3)."""
        return self.network(inputs.node_features, inputs.graph).index_select(0, inputs.fluid_nodes)

    def acceleration_target(self, state: History, displacement: Tensor) -> Tensor:
        """The normalized acceleration (N, 3) that leads from ``state`` to the next ``displacement`` (N, 3) in meters.

        The displacement is from true position to true position, also where the state has noise. So the network learns
        to undo the noise of the last displacement, but not that of the position, as in GNS.
        """
        return self.acceleration_normalizer.normalize(displacement - state.displacements[:, 0])

    def integrate(self, state: History, acceleration: Tensor) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) and velocities (N, 3) one frame later, before collision handling, by semi-implicit Euler."""
        displacement = state.displacements[:, 0] + self.acceleration_normalizer.denormalize(acceleration)
        return state.positions + displacement, displacement / FRAME_TIME

    def step(self, state: History, environment: Environment, handle_collisions: bool = True) -> tuple[History, Tensor]:
        """The state one frame later, and which particles (N,) collision handling moved."""
        acceleration = self.predict_acceleration(self.network_input(state, environment))
        positions, velocities = self.integrate(state, acceleration)
        collided = torch.zeros(len(positions), dtype=torch.bool, device=positions.device)
        if handle_collisions:
            result = resolve_collisions(state.positions, positions, velocities, environment)
            positions, velocities, collided = result.positions, result.velocities, result.collided
        return state.moved_to(positions, velocities), collided

    def with_noise(self, state: History, std: float, generator: torch.Generator) -> History:
        """A state for training, with noise injected into its displacements; see :func:`add_random_walk`."""
        return add_random_walk(state, std, generator)

    def fit_normalizers(self, examples: Iterable[tuple[History, Tensor]]) -> None:
        """Measure the normalizers on examples: a state and the true next displacement (N, 3) in meters.

        States with training noise give the statistics of GNS, which include the noise.
        """
        displacements, accelerations = RunningStatistics(), RunningStatistics()
        for state, displacement in examples:
            displacements.add(state.displacements)
            accelerations.add(displacement - state.displacements[:, 0])
        self.displacement_normalizer.set_statistics(displacements)
        self.acceleration_normalizer.set_statistics(accelerations)


def batch_inputs(parts: list[NetworkInput]) -> NetworkInput:
    """The inputs of several scenes as one, for one pass of the network; their fluid particles in order."""
    fluid_nodes, nodes = [], 0
    for part in parts:
        fluid_nodes.append(part.fluid_nodes + nodes)
        nodes += len(part.node_features)
    return NetworkInput(
        torch.cat([part.node_features for part in parts]),
        batch_graphs([part.graph for part in parts]),
        torch.cat(fluid_nodes),
    )
