"""The learned simulator: one frame at a time from positions, end-of-frame velocities and the surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from surfsup.learned.corrected.correction import Correction
from surfsup.learned.corrected.features import ACTIONS, RISE, SURROUNDINGS, observe_features
from surfsup.learned.corrected.network import ConvolutionNetwork
from surfsup.sph.collision import Look, resolve_collisions
from surfsup.sph.dfsph import density_slope
from surfsup.sph.energy import without_gain
from surfsup.sph.kernel_sums import Graph, join
from surfsup.sph.native_step import NativeStep
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import FRAME_TIME, Environment, ParticleState

OUTPUTS = 1  # a pressure
PARTICLES = ("ahead", "places", "speeds", "distance", "acts", "lie", "slope")  # of an observation


@dataclass(frozen=True)
class Architecture:
    """The sizes of a simulator; they travel with its weights.

    Attributes:
        width: channels of every particle.
        layers: steps of message passing.
        radius: connectivity radius in meters; the solver's kernel reaches 0.06.
        messages: channels of a particle that its neighbors are told of, its first; None: all.
    """

    width: int = 32
    layers: int = 5
    radius: float = 0.06
    messages: int | None = None

    def __post_init__(self) -> None:
        """Refuse what no network can be made of.

        Raises:
            ValueError: neighbors would be told of no channel, or of more than there are.
        """
        if self.messages is not None and not 0 < self.messages <= self.width:
            raise ValueError(f"messages is {self.messages}, but must be 1 to {self.width}, the width")


@dataclass(frozen=True)
class Observation:
    """One state as the network sees it.

    Attributes:
        state: the fluid now.
        ahead: (N, 3) where ballistic motion would take it, meters.
        places: (N, 3) where the sweeps would take it, meters; the network corrects these.
        speeds: (N, 3) its velocities there, m/s.
        distance: (N,) of the solid from ``ahead``, meters.
        acts: (N, 14), what acts on each particle.
        lie: (N, 6), how its neighbors lie.
        slope: (N, 3) of density at the last of the sweeps' steps, 1/m.
        graph: neighbors halfway to ``ahead``, as they lie in the last of the sweeps' steps.
    """

    state: ParticleState
    ahead: Tensor
    places: Tensor
    speeds: Tensor
    distance: Tensor
    acts: Tensor
    lie: Tensor
    slope: Tensor
    graph: Graph


class CorrectedSimulator(Simulator[ParticleState]):
    """Moves fluid particles by one frame of 0.005 s."""

    kind: ClassVar[str] = "convolution"
    architecture_type: ClassVar[type] = Architecture

    def __init__(self, architecture: Architecture) -> None:
        super().__init__(architecture)
        width, messages = architecture.width, architecture.messages or architecture.width
        self.network = ConvolutionNetwork(ACTIONS, SURROUNDINGS, OUTPUTS, width, architecture.layers, messages)
        self.native = NativeStep()

    @property
    def past(self) -> int:
        """None: positions and velocities say enough."""
        return 0

    def start(self, positions: Tensor, velocities: Tensor, environment: Environment) -> ParticleState:
        """The state of particles (N, 3) at the start of a scene."""
        return ParticleState(positions, velocities)

    def state_after(self, positions: Tensor, velocities: Tensor) -> ParticleState:
        """The state at one true frame (1, N, 3)."""
        return ParticleState(positions[0], velocities[0])

    def observe(self, state: ParticleState, environment: Environment) -> Observation:
        """See ``state``: advance it ballistically, find neighbors halfway and distances there, do as the solver would.

        Where nothing of that wants a gradient, the native step's twin does most of it.
        """
        falling = state.velocities + FRAME_TIME * environment.gravity
        if self.native.can_observe(state, environment, self.network):
            ahead, distance, told = self.native.observe(self, state, environment)
        else:
            ahead, _ = state.ballistic(environment.gravity)
            distance, normal = environment.distance_and_normal(ahead)
            radius = self.architecture.radius
            near = find_neighbors(0.5 * (state.positions + ahead), radius)
            told = observe_features(state, ahead, distance, normal, environment, near, radius)
        places, speeds = ahead + told.farther, falling + told.faster
        return Observation(state, ahead, places, speeds, distance, told.acts, told.lie, told.slope, told.graph)

    def correct(self, seen: Observation) -> Correction:
        """The network's correction to what the sweeps have made: pressures that these have missed."""
        shares = self.network(seen.acts, seen.lie, seen.graph)[:, 0]
        scale = density_slope(self.architecture.radius)
        return Correction.against(seen.acts[:, RISE], shares, seen.slope, scale, seen.graph).bounded()

    def advance(self, seen: Observation, correction: Correction) -> tuple[Tensor, Tensor]:
        """Positions (N, 3) and velocities (N, 3) one frame later, before the guard."""
        return correction.added_to(seen.places, seen.speeds)

    def step(
        self, state: ParticleState, environment: Environment, handle_collisions: bool = True
    ) -> tuple[ParticleState, Tensor]:
        """The state one frame later, and which particles (N,) the guard had to move.

        What it would gain in mechanical energy is cut back, then comes the guard. On a CPU, where no gradient is
        wanted, the native step does it all at once, up to rounding, but for the cutting back, which is rare.
        """
        if self.native.can_take(state, environment, self.network):
            taken = self.native.take(self, state, environment, handle_collisions)
            if taken.done:
                return state.moved_to(taken.positions, taken.velocities), taken.moved
            positions, velocities, last = taken.positions, taken.velocities, taken.last
        else:
            seen = self.observe(state, environment)
            positions, velocities = self.advance(seen, self.correct(seen))
            last = Look(seen.ahead, seen.distance)
        positions, velocities = without_gain(state, positions, velocities, environment.gravity)
        moved = torch.zeros(len(positions), dtype=torch.bool, device=positions.device)
        if handle_collisions:
            kept = resolve_collisions(state.positions, positions, velocities, environment, last)
            positions, velocities, moved = kept.positions, kept.velocities, kept.moved
        return state.moved_to(positions, velocities), moved


def join_observations(parts: list[Observation]) -> Observation:
    """Several scenes side by side, for one pass of the network."""
    states = [part.state for part in parts]
    return Observation(
        ParticleState(*(torch.cat([getattr(state, name) for state in states]) for name in vars(states[0]))),
        *(torch.cat([getattr(part, name) for part in parts]) for name in PARTICLES),
        join([part.graph for part in parts]),
    )
