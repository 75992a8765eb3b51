"""The density of what moves during a frame in Warp, its work on the water, and the adjoint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch
import warp as wp
from torch import Tensor

from surfsup import warp_runtime as runtime
from surfsup.sph.rigid_steps import RigidStep
from surfsup.sph.warp_engine.kernels.moving_boundary import moving_boundary_kernels

if TYPE_CHECKING:
    from surfsup.sph.warp_engine.frame import Frame


class MovingDensity:
    """Adds the solids and walls that move to the boundary density of each substep.

    Args:
        frame: whose particles they meet.
        steps: matrices (S, K, 2, 3, 3) and vectors (S, K, 2, 3) of :func:`packed`.

    Attributes:
        approach: (N,) of the present substep: density rate that their motion adds, in units of the kernel's gradient.
        work: (N,) that they have done in the frame, J/kg.
    """

    def __init__(self, frame: Frame, steps: tuple[Tensor, Tensor]) -> None:
        self.frame, self.kernels = frame, moving_boundary_kernels(frame.precision)
        self.tensors = steps
        self.steps = self._arrays(steps)
        self.approach, self.work = frame.reals(zero=True), frame.reals(zero=True)
        self.adjoints: tuple[Tensor, Tensor] | tuple[None, None] = (None, None)

    def _arrays(self, steps: tuple[Tensor, Tensor]) -> list[wp.array]:
        matrices, vectors = steps
        precision = self.frame.precision
        return [
            runtime.to_warp(matrices.flatten(0, 2), precision.mat33),
            runtime.to_warp(vectors.flatten(0, 2), precision.vec3),
        ]

    def _launches(self, number: int) -> list[tuple[wp.Kernel, list[Any]]]:
        """The kernels of a substep, with their inputs from ``place`` on."""
        boundary, first = self.frame.boundary, number * self.tensors[0].shape[1]
        launches = [(self.kernels.add_moving_solid, [first + k, *inputs]) for k, inputs in enumerate(boundary.bodies)]
        if boundary.walls is not None:
            launches.append((self.kernels.add_moving_walls, [first + len(boundary.bodies), *boundary.walls]))
        return launches

    def step(self, number: int, index: int) -> RigidStep:
        """Place and velocity of one of those that move in a substep, walls last."""
        (rotation, turn), (translation, drift) = (values[number, index] for values in self.tensors)
        return RigidStep(rotation, translation, turn, drift)

    def add(self, positions: wp.array, number: int, density: list[wp.array]) -> None:
        """Add what moves in a substep to density and gradient (N,) at ``positions`` (N,)."""
        self.approach.zero_()
        for kernel, inputs in self._launches(number):
            self.frame.launch(kernel, [positions, *self.steps, *inputs], [*density, self.approach])

    def evaluate_one(self, positions: wp.array, number: int, index: int, density: list[wp.array]) -> None:
        """Write density and gradient (N,) of one of those that move in a substep, walls last; no other changes."""
        kernel, inputs = self._launches(number)[index]
        for array in density:
            array.zero_()
        self.frame.launch(kernel, [positions, *self.steps, *inputs], [*density, self.frame.reals(zero=True)])

    def add_work(self, pressure: wp.array) -> None:
        """Add the work of the substep, in which the particles have the pressures (N,)."""
        self.frame.launch(self.kernels.add_work, [pressure, self.approach], [self.work])

    def begin_adjoint(self) -> None:
        """Prepare the derivatives in the steps, which all substeps add to."""
        matrices, vectors = (torch.zeros_like(value) for value in self.tensors)
        self.adjoints = matrices, vectors

    def add_adjoint(
        self, positions: wp.array, number: int, density: list[wp.array], adjoints: list[wp.array], found: wp.array
    ) -> None:
        """Add derivatives in positions to ``found`` (N,), and those in the steps to :attr:`adjoints`.

        Args:
            positions: (N,) in the substep.
            number: of the substep.
            density: (N,) and its gradient, as they were computed.
            adjoints: in density, gradient and approach.
            found: derivatives in positions so far.
        """
        matrices, vectors = self.adjoints
        assert matrices is not None and vectors is not None
        of_steps = self._arrays((matrices, vectors))
        outputs = [*density, self.approach]
        for kernel, inputs in self._launches(number):
            no_adjoint = [None if isinstance(value, wp.array) else value for value in inputs]
            wp.launch(
                kernel,
                self.frame.count,
                [positions, *self.steps, *inputs],
                outputs,
                adj_inputs=[found, *of_steps, *no_adjoint],
                adj_outputs=adjoints,
                adjoint=True,
                device=self.frame.device,
            )


def packed(steps: RigidStep, like: Tensor) -> tuple[Tensor, Tensor]:
    """Steps (S, K) as kernels read them, on the device and in the precision of ``like``; differentiable.

    Returns:
        Matrices (S, K, 2, 3, 3), rotation and turn, and vectors (S, K, 2, 3), translation and drift.
    """
    rotation, translation, turn, drift = steps.to(like)
    return torch.stack([rotation, turn], dim=2), torch.stack([translation, drift], dim=2)
