"""The paper's baseline: GNS, which represents the surface by particles (Sanchez-Gonzalez et al. 2020)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from surfsup.learned.message_passing.architecture import MessagePassingArchitecture, require_count
from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.message_passing.surface_particles import SurfaceParticles
from surfsup.sph.environment import Environment


@dataclass(frozen=True)
class GnsArchitecture(MessagePassingArchitecture):
    """The sizes of the baseline.

    Attributes:
        surface_particles: number of particles on the surface; the paper has 2,000 to 10,000.
    """

    surface_particles: int = 2000

    def __post_init__(self) -> None:
        super().__post_init__()
        require_count("surface_particles", self.surface_particles, 1_000_000)


class Gns(MessagePassingSimulator):
    """The paper's network with the surface as fixed particles instead of a signed distance."""

    kind: ClassVar[str] = "gns"
    architecture_type: ClassVar[type] = GnsArchitecture
    surface_feature_count: ClassVar[int] = 2

    def __init__(self, architecture: GnsArchitecture) -> None:
        super().__init__(architecture)
        self.surface_particles = SurfaceParticles(architecture.surface_particles)

    def surface_positions(self, like: Tensor, environment: Environment) -> Tensor:
        """Positions of the surface's particles (P, 3), meters; none without a surface."""
        return like[:0] if environment.surface is None else self.surface_particles.of(environment.surface).to(like)

    def nodes(self, state: History, environment: Environment) -> History:
        """The fluid's particles, then those of the surface, which have always been at rest."""
        fixed = self.surface_positions(state.positions, environment)
        at_rest = state.displacements.new_zeros(len(fixed), *state.displacements.shape[1:])
        return History(
            torch.cat([state.positions, fixed]),
            torch.cat([state.velocities, torch.zeros_like(fixed)]),
            torch.cat([state.displacements, at_rest]),
        )

    def surface_features(self, nodes: History, environment: Environment) -> Tensor:
        """The type of each node, one-hot: fluid (1, 0) or surface (0, 1).

        The columns of the encoder's first layer for these two features are the type embedding.
        """
        types = torch.zeros_like(nodes.positions[:, :2])
        fluid = len(types) - len(self.surface_positions(nodes.positions, environment))
        types[:fluid, 0], types[fluid:, 1] = 1.0, 1.0
        return types
