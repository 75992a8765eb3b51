"""The energy limiter in Warp, on arrays and as an operation of torch."""

from __future__ import annotations

from typing import Any

import torch
import warp as wp
from torch import Tensor
from torch.autograd.function import once_differentiable

from surfsup import warp_runtime as runtime
from surfsup.sph.energy_bound import HALVINGS, MAX_ENERGY_GAIN
from surfsup.sph.state import WHOLE_FRAME, FramePart, ParticleState, free_fall
from surfsup.sph.warp_engine.kernels.energy import FOLD, energy_kernels
from surfsup.warp_runtime import Precision, precision_of

MAX_PARTS = FOLD * FOLD  # partial sums of an energy


class EnergyLimiter:
    """The launches of the limiter for ``count`` particles, and its arrays. Nothing here waits for the device.

    Args:
        count: number of particles, at least one.
        gravity: (3,) on the CPU, m/s².
        precision: of the particles.
        device: Warp's.
        part: of a frame.

    Attributes:
        max_gain: (1,) float64, mean J/kg; :meth:`allow` sets it.
        choice: (1,) int32, see :mod:`surfsup.sph.warp_engine.kernels.energy`.
    """

    def __init__(
        self, count: int, gravity: Tensor, precision: Precision, device: Any, part: FramePart = WHOLE_FRAME
    ) -> None:
        self.count, self.kernels, self.device = count, energy_kernels(precision), device
        self.gravity, self.fall = (precision.vec3(*vector.tolist()) for vector in (gravity, free_fall(gravity, part)))
        self.falling = [precision.real(part.seconds), self.gravity, self.fall]
        self.max_gain = wp.full(1, MAX_ENERGY_GAIN, dtype=wp.float64, device=device)
        parts = FOLD * min(-(-count // MAX_PARTS), FOLD)
        self.gains = [wp.empty((1, size), dtype=wp.float64, device=device) for size in (parts, FOLD)]
        self.limited_gains = [wp.empty((HALVINGS, size), dtype=wp.float64, device=device) for size in (parts, FOLD)]
        self.choice = wp.empty(1, dtype=int, device=device)

    def allow(self, supplied: float) -> None:
        """Let the next frame gain a mean energy ``supplied`` in J/kg."""
        self.max_gain.fill_(MAX_ENERGY_GAIN + supplied)

    def allow_work(self, work: wp.array) -> None:
        """Let it gain the mean of the ``work`` (N,) of solids, too."""
        self._launch(self.kernels.sum_work, self.gains[0].shape[1], [work], [self.gains[0]])
        self._launch(self.kernels.fold_sums, (1, FOLD), [self.gains[0]], [self.gains[1]])
        self._launch(self.kernels.allow_work, 1, [self.gains[1], self.count], [self.max_gain])

    def allow_mean(self, work: Tensor) -> None:
        """Let it gain a mean energy that is on the device, too, J/kg."""
        allowed = runtime.to_torch(self.max_gain)
        allowed += work

    def run(self, before: list[wp.array], after: list[wp.array], targets: list[wp.array]) -> None:
        """Write the limited positions and velocities (N,) of a frame to ``targets``, which may be ``after`` itself."""
        kernels, state = self.kernels, [*before, *after]
        self._launch(kernels.sum_gains, self.gains[0].shape[1], [*state, self.gravity], [self.gains[0]])
        self._launch(kernels.fold_sums, (1, FOLD), [self.gains[0]], [self.gains[1]])
        self._launch(kernels.choose_whether_to_limit, 1, [self.gains[1], self.count, self.max_gain], [self.choice])
        self._launch(
            kernels.sum_limited_gains,
            self.limited_gains[0].shape,
            [*state, *self.falling, self.choice],
            [self.limited_gains[0]],
        )
        self._launch(kernels.fold_sums, (HALVINGS, FOLD), [self.limited_gains[0]], [self.limited_gains[1]])
        self._launch(kernels.choose_bound, 1, [self.limited_gains[1], self.count, self.max_gain], [self.choice])
        self._launch(kernels.apply_bound, self.count, [*state, *self.falling, self.choice], targets)

    def backward(self, state: list[wp.array], adjoints: list[wp.array], found: list[wp.array]) -> None:
        """Write the derivatives in the state before and after the frame, from those in the limited frame."""
        inputs = [*state, *self.falling, self.choice, *adjoints]
        self._launch(self.kernels.bound_adjoint, self.count, inputs, found)

    def _launch(self, kernel: wp.Kernel, threads: int | tuple[int, ...], inputs: list[Any], outputs: list[Any]) -> None:
        wp.launch(kernel, threads, inputs, outputs, device=self.device)


class LimitedFrame(torch.autograd.Function):
    """The limiter as an operation of torch."""

    @staticmethod
    def forward(ctx: Any, limiter: EnergyLimiter, *state: Tensor) -> tuple[Tensor, Tensor]:
        """From positions and velocities (N, 3) before and after the frame."""
        ctx.limiter, ctx.precision = limiter, precision_of(state[0].dtype)
        arrays = [runtime.to_warp(value, ctx.precision.vec3) for value in state]
        ctx.save_for_backward(*state)
        found = runtime.empty_like(state[0]), runtime.empty_like(state[0])
        ctx.limiter.run(arrays[:2], arrays[2:], [runtime.to_warp(value, ctx.precision.vec3) for value in found])
        return found

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *adjoints: Tensor) -> tuple[Tensor | None, ...]:
        """Derivatives in positions and velocities before and after the frame."""
        found = [runtime.empty_like(value) for value in ctx.saved_tensors]
        arrays = [
            [runtime.to_warp(value, ctx.precision.vec3) for value in values]
            for values in (ctx.saved_tensors, adjoints, found)
        ]
        with runtime.on_stream(found[0].device):
            ctx.limiter.backward(*arrays)
        return None, *found


def limit_energy_gain(
    state: ParticleState,
    positions: Tensor,
    velocities: Tensor,
    gravity: Tensor,
    part: FramePart = WHOLE_FRAME,
    supplied: float = 0.0,
) -> tuple[Tensor, Tensor]:
    """See :func:`surfsup.sph.energy.limit_energy_gain`; differentiable. ``gravity`` (3,) is on the CPU."""
    if len(positions) == 0:
        return positions, velocities
    runtime.load_for(energy_kernels, positions)
    with runtime.on_stream(positions.device):
        values = (state.positions, state.velocities, positions, velocities)
        limiter = EnergyLimiter(
            len(positions), gravity, precision_of(positions.dtype), runtime.warp_device(positions.device), part
        )
        limiter.allow(supplied)
        limited = LimitedFrame.apply(limiter, *(value.contiguous() for value in values))
    return limited[0], limited[1]
