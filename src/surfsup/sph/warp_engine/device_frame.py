"""A frame without gradients, recorded once and replayed: a CUDA graph on a GPU."""

from __future__ import annotations

import torch
import warp as wp
from torch import Tensor

from surfsup import warp_runtime as runtime
from surfsup.sph.environment import Environment
from surfsup.sph.state import WHOLE_FRAME, FramePart, ParticleState
from surfsup.sph.warp_engine.boundary import Boundary
from surfsup.sph.warp_engine.collision import Collisions
from surfsup.sph.warp_engine.energy import EnergyLimiter
from surfsup.sph.warp_engine.frame import Frame
from surfsup.sph.warp_engine.kernels.transfer import transfer_kernels


class DeviceFrame:
    """Ballistic motion, pressure solve, energy limiter and the container's walls, on arrays that stay in place.

    The launches of a frame are the same every time, so they are recorded in the second: on a GPU as a CUDA graph, on a
    CPU as a list of calls without Python. The first is not recorded, because the sort makes its room then. Nothing here
    waits for the device.

    Args:
        state: particles, at least one, whose number, precision and device all frames have.
        environment: container and gravity; without a solid, or with its boundary map.
        boundary: the same for the kernels.
        capacity: neighbors of a particle for which there is room.
        part: of a frame.
        steps: of what moves, as :class:`Frame` takes them; None where nothing moves.

    Attributes:
        frame: the pressure solve.
    """

    def __init__(
        self,
        state: ParticleState,
        environment: Environment,
        boundary: Boundary,
        capacity: int,
        part: FramePart = WHOLE_FRAME,
        steps: tuple[Tensor, Tensor] | None = None,
    ) -> None:
        self.part = part
        kept = None if steps is None else (steps[0].clone(), steps[1].clone())
        self.frame = Frame(state.positions, boundary, capacity, part=part, steps=kept)
        precision, device, count = self.frame.precision, self.frame.device, self.frame.count
        self.limiter = EnergyLimiter(count, environment.on_host.gravity, precision, device, part)
        self.collisions = Collisions(environment, state.positions)
        self.before = [self.frame.unsorted() for _ in range(2)]
        self.after = [self.frame.unsorted() for _ in range(2)]
        self.contained = [self.frame.unsorted() for _ in range(2)]
        self.collided = torch.empty(count, dtype=torch.bool, device=state.positions.device)
        self.predicted = self.frame.vectors()
        self.graph: wp.Graph | None = None
        self.runs = 0

    def serves(self, state: ParticleState, boundary: Boundary, capacity: int, part: FramePart = WHOLE_FRAME) -> bool:
        """Whether these particles can be advanced with these arrays."""
        positions, like = state.positions, self.before[0]
        alike = (positions.shape, positions.dtype, positions.device) == (like.shape, like.dtype, like.device)
        same = self.frame.boundary is boundary and self.frame.search.capacity == capacity and self.part == part
        return alike and same

    def run(
        self,
        state: ParticleState,
        handle_collisions: bool,
        supplied: float = 0.0,
        steps: tuple[Tensor, Tensor] | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Positions and velocities (N, 3) one frame or part later, and which particles (N,) a wall moved.

        Beside what moves, walls are left to collision handling.

        Args:
            state: particles at the frame's start.
            handle_collisions: whether the walls move particles.
            supplied: energy that the frame may gain, mean J/kg.
            steps: of what moves, as many as at first.
        """
        for target, value in zip(self.before, (state.positions, state.velocities), strict=True):
            target.copy_(value)
        if steps is not None and self.frame.moving is not None:
            for target, value in zip(self.frame.moving.tensors, steps, strict=True):
                target.copy_(value)
        self.limiter.allow(supplied)
        if self.runs == 0:
            self.launch()
        else:
            if self.graph is None:
                with runtime.recording(self.frame.device) as capture:
                    self.launch()
                self.graph = capture.graph
            wp.capture_launch(self.graph)
        self.runs += 1
        if handle_collisions and self.frame.moving is None:
            return self.contained[0].clone(), self.contained[1].clone(), self.collided.clone()
        return self.after[0].clone(), self.after[1].clone(), torch.zeros_like(self.collided)

    def launch(self) -> None:
        """The launches of a frame."""
        before, after, contained = (
            self.collisions.vectors(*tensors) for tensors in (self.before, self.after, self.contained)
        )
        self.frame.launch(
            transfer_kernels(self.frame.precision).predict_particles,
            [*before, self.frame.seconds, self.limiter.fall],
            [self.predicted],
        )
        self.frame.run(before[0], before[1], self.predicted, (None, None), after)
        if self.frame.moving is not None:
            self.limiter.allow_work(self.frame.moving.work)
        self.limiter.run(before, after, after)
        collided = runtime.to_warp(self.collided, wp.bool)
        self.collisions.launch(
            self.collisions.kernels.clamp_to_container,
            self.frame.count,
            [*after, *self.collisions.corners],
            [*contained, collided],
        )
