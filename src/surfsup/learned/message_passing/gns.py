"""The baseline: GNS, which knows the surface as particles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from surfsup.learned.message_passing.architecture import MessagePassingArchitecture, within
from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.message_passing.surface_particles import SurfaceParticles
from surfsup.sph.state import Environment


@dataclass(frozen=True)
class GnsArchitecture(MessagePassingArchitecture):
    """The sizes of the baseline.

    Attributes:
        surface_particles: how many stand for the surface; the paper has 2,000 to 10,000.
    """

    surface_particles: int = 2000

    def __post_init__(self) -> None:
        super().__post_init__()
        within("surface_particles", self.surface_particles, 1_000_000)


class Gns(MessagePassingSimulator):
    """The paper's network with the surface as particles that never move, and without its distance."""

    kind: ClassVar[str] = "gns"
    architecture_type: ClassVar[type] = GnsArchitecture
    extra_features: ClassVar[int] = 2

    def __init__(self, architecture: GnsArchitecture) -> None:
        super().__init__(architecture)
        self.particles = SurfaceParticles(architecture.surface_particles)

    def fixed(self, like: Tensor, environment: Environment) -> Tensor:
        """The surface's particles (P, 3), none without a surface."""
        return like[:0] if environment.surface is None else self.particles.on(environment.surface).to(like)

    def nodes(self, state: History, environment: Environment) -> History:
        """The fluid's particles, then the surface's, which have always been where they are."""
        fixed = self.fixed(state.positions, environment)
        still = state.moves.new_zeros(len(fixed), *state.moves.shape[1:])
        return History(
            torch.cat([state.positions, fixed]),
            torch.cat([state.velocities, torch.zeros_like(fixed)]),
            torch.cat([state.moves, still]),
        )

    def see_extra(self, nodes: History, environment: Environment) -> Tensor:
        """Which kind a node is, fluid (1, 0) or surface (0, 1).

        The columns of the encoder's first layer that these pick are the embedding of the two kinds.
        """
        kinds = torch.zeros_like(nodes.positions[:, :2])
        fluid = len(kinds) - len(self.fixed(nodes.positions, environment))
        kinds[:fluid, 0], kinds[fluid:, 1] = 1.0, 1.0
        return kinds
