"""SURFSUP with the end-of-frame velocity in its state: our own variant, not the paper's."""

from __future__ import annotations

from typing import ClassVar

import torch
from torch import Tensor

from surfsup.learned.message_passing.architecture import MessagePassingArchitecture
from surfsup.learned.message_passing.history import History
from surfsup.learned.message_passing.noise import random_walk
from surfsup.learned.message_passing.normal import Normal
from surfsup.learned.message_passing.simulator import ACCELERATION_SPREAD
from surfsup.learned.message_passing.surfsup import Surfsup
from surfsup.sph.state import Environment


class SurfsupVelocity(Surfsup):
    """The same network, told how much faster each particle ends its last step than it moved, and asked for that anew.

    A step is several of the solver's, so a move tells a mean velocity; what struck late in it shows only in the
    velocity at its end.
    """

    kind: ClassVar[str] = "surfsup-velocity"
    outputs: ClassVar[int] = 6
    extra_features: ClassVar[int] = Surfsup.extra_features + 3

    def __init__(self, architecture: MessagePassingArchitecture) -> None:
        super().__init__(architecture)
        spread = [architecture.stride**2 * spread for spread in ACCELERATION_SPREAD]
        self.leads, self.gains = Normal(spread), Normal(spread)

    def lead(self, state: History) -> Tensor:
        """How much farther a step at the end velocity would take a particle than its last step did (N, 3), meters."""
        return self.step_time * state.velocities - state.moves[:, 0]

    def gain(self, state: History, velocities: Tensor) -> Tensor:
        """How much farther a step at ``velocities`` (N, 3) takes a particle than one at the state's own, meters."""
        return self.step_time * (velocities - state.velocities)

    def see_extra(self, nodes: History, environment: Environment) -> Tensor:
        """Signed distance (1), its gradient (3), and the lead (3)."""
        return torch.cat([super().see_extra(nodes, environment), self.leads.normalize(self.lead(nodes))], dim=-1)

    def wanted(self, state: History, move: Tensor, velocities: Tensor) -> Tensor:
        """The acceleration (3) and the gain of end velocity (3), normalized."""
        gain = self.gains.normalize(self.gain(state, velocities))
        return torch.cat([super().wanted(state, move, velocities), gain], dim=-1)

    def advance(self, state: History, predicted: Tensor) -> tuple[Tensor, Tensor]:
        """Positions and end velocities (N, 3) one step later, before the guard."""
        positions, _ = super().advance(state, predicted)
        return positions, state.velocities + self.gains.restore(predicted[:, 3:]) / self.step_time

    def with_noise(self, state: History, size: float, generator: torch.Generator) -> History:
        """Noise on the moves as ever; the end velocity has that of the last move and as much again of its own."""
        noisy, last = random_walk(state, size, generator)
        own = torch.randn(last.shape, generator=generator, device=generator.device).to(last) * size
        return History(noisy.positions, noisy.velocities + (last + own) / self.step_time, noisy.moves)

    def quantities(self, state: History, move: Tensor, velocities: Tensor) -> dict[Normal, Tensor]:
        """As ever, with lead and gain."""
        more = {self.leads: self.lead(state), self.gains: self.gain(state, velocities)}
        return {**super().quantities(state, move, velocities), **more}
