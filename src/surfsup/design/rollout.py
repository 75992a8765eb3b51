"""A rollout through which gradients flow from the last frame back into the shape.

Memory: what a frame needs on the way back is kept for one segment of frames at a time and made anew for each (Chen et
al., "Training deep nets with sublinear memory cost", 2016). With segments as long as there are many of them it grows
with the square root of the frames.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup.errors import SimulationError
from surfsup.learned.corrected.simulator import CorrectedSimulator
from surfsup.sph.state import Environment, ParticleState

FLUID_TENSORS = 3  # two of the state, and the positions of all
Particles = tuple[Tensor, Tensor]  # positions (N, 3) in meters and velocities (N, 3) in m/s


@dataclass(frozen=True)
class Water:
    """What is poured, and when particles come and go.

    Attributes:
        positions: (N, 3) at frame 0, meters.
        velocities: (N, 3) at frame 0, m/s.
        entering: by number of the frame, the particles that join the simulation at its end.
        floor: height in meters at which a particle leaves the simulation, for good; None keeps all.
    """

    positions: Tensor
    velocities: Tensor
    entering: Mapping[int, Particles] = field(default_factory=dict)
    floor: float | None = None

    def every_particle(self) -> Tensor:
        """Where each particle (N, 3) begins: those of frame 0, then those that enter, in the order of their frames."""
        return torch.cat([self.positions, *(self.entering[frame][0] for frame in sorted(self.entering))])


@dataclass(frozen=True)
class Fluid:
    """All particles at the end of a frame, in the order in which they come; never sorted anew.

    Attributes:
        state: of those in the simulation.
        members: (M,) int64, which they are.
        positions: (N, 3) meters of all: where it began for one that is yet to enter, where it landed for one that left.
        landed: (N,) bool, who has left.
    """

    state: ParticleState
    members: Tensor
    positions: Tensor
    landed: Tensor


def begin(water: Water, environment: Environment) -> Fluid:
    """The fluid at frame 0."""
    everyone = water.every_particle()
    state = ParticleState(water.positions, water.velocities)
    return Fluid(
        state,
        torch.arange(len(water.positions), device=everyone.device),
        everyone,
        torch.zeros(len(everyone), dtype=torch.bool, device=everyone.device),
    )


def advance(
    simulator: CorrectedSimulator,
    fluid: Fluid,
    environment: Environment,
    water: Water,
    frame: int,
    lands: Tensor | None = None,
) -> Fluid:
    """The fluid one frame later, at the end of ``frame``; differentiable in places, velocities and shape.

    Args:
        simulator: what moves the particles.
        fluid: at the end of the frame before.
        environment: container, solid and gravity.
        water: who enters, and where the floor is.
        frame: number of the frame.
        lands: (N,) who has landed by its end, where that is decided already: a repetition must not decide anew, for
            its rounding may differ.
    """
    if not len(fluid.members):
        return entered(fluid, water, environment, frame)
    before = fluid.state.positions
    state, _ = simulator.step(fluid.state, environment)
    members, here = fluid.members, state.positions
    if water.floor is None:
        moved = fluid.positions.index_copy(0, members, here)
        return entered(Fluid(state, members, moved, fluid.landed), water, environment, frame)
    down = here[:, 2] <= water.floor if lands is None else lands[members]
    here = torch.where(down[:, None], crossing(before, here, water.floor), here)
    staying = (~down).nonzero().squeeze(1)
    after = Fluid(
        chosen(state, staying),
        members[staying],
        fluid.positions.index_copy(0, members, here),
        fluid.landed.index_fill(0, members[down], True),
    )
    return entered(after, water, environment, frame)


def crossing(before: Tensor, after: Tensor, height: float) -> Tensor:
    """Where straight lines from ``before`` to ``after`` (N, 3) pass ``height``; the landing place carries gradients.

    One that was below at once has its own place at that height.
    """
    drop = before[:, 2:] - after[:, 2:]
    falling = drop > 0
    share = torch.where(falling, (before[:, 2:] - height) / torch.where(falling, drop, 1.0), 1.0).clamp(0, 1)
    place = before + share * (after - before)
    return torch.cat([place[:, :2], torch.full_like(place[:, 2:], height)], dim=-1)


def chosen(state: ParticleState, which: Tensor) -> ParticleState:
    """The particles ``which`` (K,) of a state, alone."""
    return ParticleState(*(value.index_select(0, which) for value in vars(state).values()))


def entered(fluid: Fluid, water: Water, environment: Environment, frame: int) -> Fluid:
    """The fluid with those who enter at the end of ``frame``."""
    if frame not in water.entering:
        return fluid
    new = ParticleState(*water.entering[frame])
    first = len(water.positions) + sum(len(water.entering[earlier][0]) for earlier in water.entering if earlier < frame)
    numbers = torch.arange(first, first + len(new.positions), device=new.positions.device)
    state = ParticleState(*(torch.cat([getattr(fluid.state, name), value]) for name, value in vars(new).items()))
    return Fluid(state, torch.cat([fluid.members, numbers]), fluid.positions, fluid.landed)


def last_frame(simulator: CorrectedSimulator, environment: Environment, water: Water, frames: int) -> Fluid:
    """The fluid after ``frames`` frames, differentiable in whatever records gradients.

    Raises:
        SimulationError: the simulation blew up or collapsed.
    """
    fluid, length = begin(water, environment), max(1, math.isqrt(frames))
    shape = environment.recording()
    for first in range(1, frames + 1, length):
        stretch = Stretch(simulator, environment, water, range(first, min(first + length, frames + 1)), fluid)
        tensors = Repeated.apply(stretch, *vars(fluid.state).values(), fluid.positions, *shape)
        fluid = stretch.fluid_of(tensors, -1)
    if not bool(torch.isfinite(fluid.positions).all()):
        raise SimulationError("the simulation blew up: a particle's position is not a finite number")
    return fluid


class Stretch:
    """Some frames in a row that are simulated twice: without gradients, then with."""

    def __init__(
        self, simulator: CorrectedSimulator, environment: Environment, water: Water, span: range, fluid: Fluid
    ) -> None:
        self.simulator, self.environment, self.water, self.span = simulator, environment, water, span
        self.members, self.landed = [fluid.members], [fluid.landed]  # at its start and at the end of each frame

    def run(self, tensors: Sequence[Tensor]) -> tuple[Tensor, ...]:
        """The tensors of the fluid at its end, from those at its start; the first time it notes who lands when."""
        again = len(self.landed) > 1
        fluid = self.fluid_of(tensors, 0)
        for number, frame in enumerate(self.span, start=1):
            lands = self.landed[number] if again else None
            fluid = advance(self.simulator, fluid, self.environment, self.water, frame, lands)
            if not again:
                self.members.append(fluid.members)
                self.landed.append(fluid.landed)
        return (*vars(fluid.state).values(), fluid.positions)

    def fluid_of(self, tensors: Sequence[Tensor], number: int) -> Fluid:
        """The fluid of those tensors at its start (0) or after so many of its frames."""
        *state, positions = tensors
        return Fluid(ParticleState(*state), self.members[number], positions, self.landed[number])


class Repeated(torch.autograd.Function):
    """A stretch of frames of which nothing is kept but its start; the way back simulates it again.

    Forward it takes no gradients, so that the native step may do it, ten times faster than torch.
    """

    @staticmethod
    def forward(context: Any, stretch: Stretch, *tensors: Tensor) -> tuple[Tensor, ...]:
        """Two tensors of the state, the positions of all, then those of the shape, which the surface holds too."""
        context.stretch = stretch
        context.save_for_backward(*tensors)
        return stretch.run(tensors[:FLUID_TENSORS])

    @staticmethod
    @once_differentiable
    def backward(context: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients in the fluid at the start and in the shape."""
        fluid, shape = context.saved_tensors[:FLUID_TENSORS], context.saved_tensors[FLUID_TENSORS:]
        with torch.enable_grad():
            inputs = [tensor.detach().requires_grad_() for tensor in fluid]
            outputs = context.stretch.run(inputs)
        reached = [(one, gradient) for one, gradient in zip(outputs, gradients, strict=True) if one.requires_grad]
        found = torch.autograd.grad(
            [one for one, _ in reached], [*inputs, *shape], [gradient for _, gradient in reached], allow_unused=True
        )
        return None, *found


@torch.no_grad()
def every_frame(simulator: CorrectedSimulator, environment: Environment, water: Water, frames: int) -> Iterator[Fluid]:
    """Frame 0 and the ``frames`` after it, without gradients, by the native step where that is built."""
    fluid = begin(water, environment)
    yield fluid
    for frame in range(1, frames + 1):
        fluid = advance(simulator, fluid, environment, water, frame)
        yield fluid
