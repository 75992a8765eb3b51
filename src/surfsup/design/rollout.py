"""Differentiable rollouts: gradients of the last frame with respect to the shape.

Memory is limited by gradient checkpointing (Chen et al., "Training deep nets with sublinear memory cost", 2016): the
forward pass stores only the state at the start of each segment of frames, and the backward pass simulates the segment
again. With segments of about the square root of the number of frames, memory grows with that root.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup.errors import SimulationError
from surfsup.native.dispatch import tensors_requiring_grad
from surfsup.sph.environment import Environment
from surfsup.sph.simulator import Simulator
from surfsup.sph.state import ParticleState


class GradientNotFinite(SimulationError):
    """A gradient became infinite or NaN on its way back through the frames.

    Attributes:
        frames: the first and the last of the frames, counted from 1, in one of which that happened.
    """

    def __init__(self, first: int, last: int) -> None:
        place = f"frame {first}" if first == last else f"one of the frames {first} to {last}"
        super().__init__(
            f"the gradient is not finite: it cannot be followed back through {place}; use fewer frames, or move the "
            "water's start a little"
        )
        self.frames = first, last


STATE_TENSORS = 3  # positions and velocities of the active particles, positions of all


@dataclass(frozen=True)
class Particles:
    """All particles at the end of a frame, in their initial order. Those that have landed are no longer simulated.

    Attributes:
        state: the active particles.
        active: (M,) int64, their indices.
        positions: (N, 3) of all particles, meters; the landing position of those that have landed.
        landed: (N,) bool.
    """

    state: ParticleState
    active: Tensor
    positions: Tensor
    landed: Tensor

    @classmethod
    def at_start(cls, state: ParticleState) -> Particles:
        """The particles at frame 0, all of them active."""
        count, device = len(state.positions), state.positions.device
        indices = torch.arange(count, device=device)
        return cls(state, indices, state.positions, torch.zeros(count, dtype=torch.bool, device=device))


def advance(
    simulator: Simulator[ParticleState],
    particles: Particles,
    environment: Environment,
    floor: float | None = None,
    landed: Tensor | None = None,
) -> Particles:
    """The particles one frame later, differentiable with respect to positions, velocities and shape.

    Args:
        simulator: advances the active particles.
        particles: at the end of the frame before.
        environment: container, surface and gravity.
        floor: height in meters at which a particle lands; None for no floor.
        landed: (N,), which particles have landed by the end of the frame, if that is known. A repetition must not
            decide again, because its rounding may differ.
    """
    if not len(particles.active):
        return particles
    before, active = particles.state.positions, particles.active
    state, _ = simulator.step(particles.state, environment)
    after = state.positions
    if floor is None:
        return Particles(state, active, particles.positions.index_copy(0, active, after), particles.landed)
    lands = after[:, 2] <= floor if landed is None else landed[active]
    after = torch.where(lands[:, None], crossing_point(before, after, floor), after)
    remaining = (~lands).nonzero().squeeze(1)
    return Particles(
        ParticleState(*(value.index_select(0, remaining) for value in vars(state).values())),
        active[remaining],
        particles.positions.index_copy(0, active, after),
        particles.landed.index_fill(0, active[lands], True),
    )


def crossing_point(before: Tensor, after: Tensor, height: float) -> Tensor:
    """Where the lines from ``before`` to ``after`` (N, 3) cross ``height``, differentiable.

    A particle that starts below has its own position, at that height.
    """
    drop = before[:, 2:] - after[:, 2:]
    falling = drop > 0
    fraction = torch.where(falling, (before[:, 2:] - height) / torch.where(falling, drop, 1.0), 1.0).clamp(0, 1)
    point = before + fraction * (after - before)
    return torch.cat([point[:, :2], torch.full_like(point[:, 2:], height)], dim=-1)


def last_frame(
    simulator: Simulator[ParticleState],
    environment: Environment,
    start: ParticleState,
    frames: int,
    floor: float | None = None,
) -> Particles:
    """The particles after ``frames`` frames, differentiable with respect to everything that requires gradients.

    Raises:
        SimulationError: the simulation diverged.
        GradientNotFinite: by the backward pass.
    """
    particles, length = Particles.at_start(start), max(1, math.isqrt(frames))
    shape = tensors_requiring_grad(environment.surface)
    for first in range(0, frames, length):
        segment = Segment(simulator, environment, floor, first, min(length, frames - first), particles)
        tensors = CheckpointedSegment.apply(segment, *vars(particles.state).values(), particles.positions, *shape)
        particles = segment.particles_from(tensors, -1)
    if not bool(torch.isfinite(particles.positions).all()):
        raise SimulationError("the simulation diverged: a particle's position is not a finite number")
    return particles


class Segment:
    """Consecutive frames that are simulated twice: forward without gradients, in the backward pass with gradients."""

    def __init__(
        self,
        simulator: Simulator[ParticleState],
        environment: Environment,
        floor: float | None,
        first: int,
        frames: int,
        start: Particles,
    ) -> None:
        self.simulator, self.environment, self.floor = simulator, environment, floor
        self.first, self.frames = first, frames  # frames before the segment and in it
        self.states: list[Tensor] = []  # of the repetition, at the end of each frame but the last
        self.active, self.landed = [start.active], [start.landed]  # at the start and at the end of each frame

    def run(self, tensors: Sequence[Tensor]) -> tuple[Tensor, ...]:
        """The tensors of the particles at the end, from those at the start. The first run records who lands when."""
        repetition = len(self.landed) > 1
        particles = self.particles_from(tensors, 0)
        for frame in range(1, self.frames + 1):
            landed = self.landed[frame] if repetition else None
            particles = advance(self.simulator, particles, self.environment, self.floor, landed)
            if not repetition:
                self.active.append(particles.active)
                self.landed.append(particles.landed)
            elif frame < self.frames:
                self.states += vars(particles.state).values()
        return (*vars(particles.state).values(), particles.positions)

    def particles_from(self, tensors: Sequence[Tensor], frame: int) -> Particles:
        """The particles with these tensors at the end of a frame of the segment; 0 is its start."""
        *state, positions = tensors
        return Particles(ParticleState(*state), self.active[frame], positions, self.landed[frame])


class CheckpointedSegment(torch.autograd.Function):
    """A segment that stores nothing but its start.

    The forward pass records no gradients, so C++ can simulate it, several times as fast as Warp.
    """

    @staticmethod
    def forward(ctx: Any, segment: Segment, *tensors: Tensor) -> tuple[Tensor, ...]:
        """From the tensors of the particles and of the shape; the surface holds the latter, too."""
        ctx.segment = segment
        ctx.save_for_backward(*tensors)
        return segment.run(tensors[:STATE_TENSORS])

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients of the particles at the start and of the shape."""
        particles, shape = ctx.saved_tensors[:STATE_TENSORS], ctx.saved_tensors[STATE_TENSORS:]
        with torch.enable_grad():
            inputs = [tensor.detach().requires_grad_() for tensor in particles]
            outputs = ctx.segment.run(inputs)
        pairs = [(output, given) for output, given in zip(outputs, gradients, strict=True) if output.requires_grad]
        of = [*ctx.segment.states, *inputs, *shape]
        ctx.segment.states = []
        found = torch.autograd.grad(
            [output for output, _ in pairs], of, [given for _, given in pairs], allow_unused=True
        )
        check_gradients(found, len(shape), ctx.segment)
        return None, *found[len(found) - len(inputs) - len(shape) :]


def check_gradients(gradients: Sequence[Tensor | None], shape: int, segment: Segment) -> None:
    """Check the gradients of a segment: of its states by frame, of its start, and of ``shape`` tensors of the shape.

    Raises:
        GradientNotFinite: one is not.
    """
    of_shape = len(gradients) - shape
    at_start = 2 * (segment.frames - 1)  # after positions and velocities at the end of each frame but the last
    parts = [gradients[of_shape:], gradients[at_start:of_shape]]
    parts += [gradients[at : at + 2] for at in range(0, at_start, 2)]
    broken = [not finite for finite in torch.stack([all_finite(part) for part in parts]).tolist()]
    if any(broken[1:]):
        frame = segment.first + len(broken) - 1 - broken[::-1].index(True)
        raise GradientNotFinite(frame, frame)
    if broken[0]:
        raise GradientNotFinite(segment.first + 1, segment.first + segment.frames)


def all_finite(values: Sequence[Tensor | None]) -> Tensor:
    """Whether every number is finite; a gradient that is not there is zero."""
    checks = [torch.isfinite(value).all() for value in values if value is not None]
    return torch.stack(checks).all() if checks else torch.tensor(True)


@torch.no_grad()
def all_frames(
    simulator: Simulator[ParticleState],
    environment: Environment,
    start: ParticleState,
    frames: int,
    floor: float | None = None,
) -> Iterator[Particles]:
    """Frame 0 and the ``frames`` after it, without gradients."""
    particles = Particles.at_start(start)
    yield particles
    for _ in range(frames):
        particles = advance(simulator, particles, environment, floor)
        yield particles
