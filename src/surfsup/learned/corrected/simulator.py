"""A network on top of the DFSPH solver: it corrects what each frame of the solver leaves wrong."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar

import torch
from torch import Tensor

from surfsup.learned.base import LearnedSimulator
from surfsup.learned.corrected.correction import Correction
from surfsup.learned.corrected.features import neighborhood_features, particle_features
from surfsup.learned.corrected.network import ConvolutionNetwork
from surfsup.sph.collision import LastQuery
from surfsup.sph.dfsph import Substep
from surfsup.sph.environment import Environment
from surfsup.sph.kernel_sums import join_graphs
from surfsup.sph.solver import DfsphSolver, Observation, finish_step
from surfsup.sph.state import ParticleState


@dataclass(frozen=True)
class CorrectedArchitecture:
    """The sizes of the network.

    Attributes:
        width: channels of a particle.
        layers: neighbor convolutions.
    """

    width: int = 16
    layers: int = 1


class CorrectedSimulator(LearnedSimulator[ParticleState]):
    """Advances particles by a frame of the DFSPH solver and a learned correction."""

    kind: ClassVar[str] = "corrected"
    architecture_type: ClassVar[type] = CorrectedArchitecture
    history_length: ClassVar[int] = 0

    def __init__(self, architecture: CorrectedArchitecture) -> None:
        super().__init__(architecture)
        self.network = ConvolutionNetwork(architecture.width, architecture.layers)
        self.solver = DfsphSolver()

    def initial_state(self, positions: Tensor, velocities: Tensor, environment: Environment) -> ParticleState:
        """The state of particles (N, 3) at the start of a scene."""
        return self.solver.initial_state(positions, velocities, environment)

    def state_from_frames(self, positions: Tensor, velocities: Tensor) -> ParticleState:
        """The state at one frame (1, N, 3)."""
        return self.solver.state_from_frames(positions, velocities)

    def observe(self, state: ParticleState, environment: Environment) -> Observation:
        """The solver's frame, which the network corrects."""
        return self.solver.observe(state, environment)

    def correct(self, observation: Observation) -> Correction:
        """The network's correction to the solver's frame."""
        features, neighborhood = particle_features(observation), neighborhood_features(observation)
        output = self.network(features, neighborhood, observation.substep.graph)
        return Correction.from_pressure(output, observation).bounded()

    def step(
        self, state: ParticleState, environment: Environment, handle_collisions: bool = True
    ) -> tuple[ParticleState, Tensor]:
        """The state one frame later, and which particles (N,) collision handling moved.

        Its gradients reach the network's weights, but neither the state before nor the solid.

        Raises:
            SimulationError: a position is not finite, or the particles have collapsed into a clump.
        """
        observation = self.observe(state, environment)
        correction = self.correct(observation)
        positions, velocities = correction.added_to(observation.positions, observation.velocities)
        return finish_step(state, positions, velocities, environment, observation.last_query, handle_collisions)


def join_observations(parts: list[Observation]) -> Observation:
    """Observations of several scenes as one, for one pass of the network."""
    states, substeps, queries = ([getattr(part, name) for part in parts] for name in ("state", "substep", "last_query"))
    graph = join_graphs([substep.graph for substep in substeps])
    return Observation(
        state=ParticleState(**concatenated(states)),
        last_query=LastQuery(**concatenated(queries)),
        substep=Substep(graph=graph, **concatenated(substeps)),
        **concatenated(parts),
    )


def concatenated(records: list[Any]) -> dict[str, Tensor]:
    """The tensors of several records of one type, each concatenated, by name."""
    names = (field.name for field in fields(records[0]) if isinstance(getattr(records[0], field.name), Tensor))
    return {name: torch.cat([getattr(record, name) for record in records]) for name in names}
