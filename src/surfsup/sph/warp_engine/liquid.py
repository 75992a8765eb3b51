"""Surface tension, adhesion, friction and implicit viscosity of a substep in Warp; as ``native/sph/liquid_solver.cpp``.

Kernels sum over neighbors, torch does the rest on the device. The formulas are in :mod:`surfsup.sph.liquid`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import torch
import warp as wp
from torch import Tensor

from surfsup import warp_runtime as runtime
from surfsup.sph import dfsph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.liquid import MAX_ITERATIONS, TOLERANCE, LiquidForces
from surfsup.sph.rigid_steps import RigidStep
from surfsup.sph.warp_engine.impulses import WALLS
from surfsup.sph.warp_engine.kernels.boundary import NO_SOLID, VOLUME_MAP
from surfsup.sph.warp_engine.kernels.liquid import liquid_kernels

if TYPE_CHECKING:
    from surfsup.sph.warp_engine.frame import Frame


@dataclass(frozen=True)
class Contact:
    """A solid near the particles, in sorted order.

    Attributes:
        row: of its impulses; None for what stands still.
        normal: (N, 3), unit where it is near.
        velocity: (N, 3) of the solid, m/s.
        density: (N,).
        along, across: (N,) friction along the normal and across, times the density, 1/s.
        pull: (N,) change of velocity by adhesion, m/s.
    """

    row: int | None
    normal: Tensor
    velocity: Tensor
    density: Tensor
    along: Tensor
    across: Tensor
    pull: Tensor


class LiquidStep:
    """What a liquid adds to the substeps of a frame.

    Args:
        frame: of its particles.
        forces: its coefficients.
        gravity: (3,) on the device, m/s².
        steps: (S, K) on the CPU, of what moves in each substep; None where nothing moves.

    Attributes:
        work: mean J/kg that tension, adhesion and moving solids did on the water; on the device.
        viscous: whether the viscosity is implicit, in the place of the solver's own.
    """

    def __init__(self, frame: Frame, forces: LiquidForces, gravity: Tensor, steps: RigidStep | None) -> None:
        self.frame, self.kernels, self.gravity = frame, liquid_kernels(frame.precision), gravity
        self.steps = steps
        self.coefficients = forces.coefficients
        self.viscous = forces.viscosity is not None
        self.time = float(frame.time)
        self.density = frame.reals()
        self.change = frame.unsorted().zero_()
        self.work = torch.zeros((), dtype=torch.float64, device=frame.torch_device)

    def advance(self, number: int, motion: list[wp.array]) -> None:
        """Change the velocities in ``motion``, positions and velocities (N,) at the start of a substep."""
        positions, velocities = (runtime.to_torch(value) for value in motion)
        pairs = [motion[0], self.frame.search.neighbors, self.frame.search.counts]
        falling = number * self.time * self.gravity
        before = kinetic_energy(velocities + falling)
        self.frame.launch(self.kernels.measure_density, pairs, [self.density])
        contacts = self.contacts(number, motion[0])
        density = runtime.to_torch(self.density)
        for contact in contacts:
            density += contact.density
        self.add(velocities, -sum((contact.pull[:, None] * contact.normal for contact in contacts), torch.zeros(())))
        if self.coefficients["cohesion"] != 0:
            self.add(velocities, self.time * self.tension(pairs))
        attracted = kinetic_energy(velocities + falling)
        self.work += attracted - before
        solution = None
        if self.viscous:
            solution = self.solve_viscosity(number, pairs, velocities, falling, contacts)
            if self.frame.moving is not None:
                self.work += (kinetic_energy(velocities + falling) - attracted).clamp(min=0)
        self.add_impulses(positions, solution, contacts)

    def add(self, velocities: Tensor, change: Tensor) -> None:
        """Add a change (N, 3) to velocities, and to those relative to free fall."""
        velocities += change
        delta = runtime.to_torch(self.frame.delta_velocity)
        delta += change

    def tension(self, pairs: list[wp.array]) -> Tensor:
        """Accelerations (N, 3) by surface tension, m/s²."""
        normals, acceleration = self.frame.vectors(), self.frame.vectors()
        self.frame.launch(self.kernels.find_normals, [*pairs, self.density], [normals])
        real = self.frame.precision.real
        factors = [real(self.coefficients[name]) for name in ("cohesion", "curvature")]
        self.frame.launch(self.kernels.sum_tension, [*pairs, self.density, normals, *factors], [acceleration])
        return runtime.to_torch(acceleration)

    def solve_viscosity(
        self, number: int, pairs: list[wp.array], velocities: Tensor, falling: Tensor, contacts: list[Contact]
    ) -> Tensor:
        """Change the velocities by viscosity and friction, and return the solution (N, 3) itself.

        Conjugate gradients with the blocks on the diagonal as preconditioner. On a CPU they end when the residual is
        small enough; on a GPU all iterations are launched, and those after that change nothing.
        """
        friction, dragged = self.friction(contacts)
        scale = self.time * self.coefficients["viscosity"] * dfsph.GRADIENT_SCALE / KERNEL_SUPPORT
        factors, precision = self.frame.factors, self.frame.precision
        blocks = wp.empty(self.frame.count, dtype=precision.mat33, device=self.frame.device)
        self.frame.launch(
            self.kernels.prepare_viscosity, [*pairs, self.density, precision.real(scale)], [factors, blocks]
        )
        identity = torch.eye(3, dtype=velocities.dtype, device=velocities.device)
        inverse = inverse_of(runtime.to_torch(blocks) + identity + self.time * friction)
        product = self.frame.unsorted()

        def multiply(vectors: Tensor) -> Tensor:
            arrays = [runtime.to_warp(value, precision.vec3) for value in (vectors, product)]
            self.frame.launch(self.kernels.multiply, [*pairs, factors, arrays[0]], [arrays[1]])
            return product + vectors + self.time * times(friction, vectors)

        start = velocities + falling
        solution = start + self.change if number > 0 else start.clone()
        residual = start + self.time * dragged - multiply(solution)
        direction = times(inverse, residual)
        along = dot(residual, direction)
        enough = TOLERANCE**2 * self.frame.count
        for _ in range(MAX_ITERATIONS):
            going = dot(residual, residual) > enough
            if going.device.type == "cpu" and not going:
                break
            image = multiply(direction)
            length = torch.where(going, along / dot(direction, image), 0.0).to(start.dtype)
            solution = solution + length * direction
            residual = residual - length * image
            conditioned = times(inverse, residual)
            following = dot(residual, conditioned)
            direction = conditioned + torch.where(going, following / along, 0.0).to(start.dtype) * direction
            along = following
        # With its residual the solution is what its pair forces make of the start, so that momentum is conserved.
        self.change = solution + residual - start
        self.add(velocities, self.change)
        return solution

    def friction(self, contacts: list[Contact]) -> tuple[Tensor, Tensor]:
        """The blocks of friction (N, 3, 3), 1/s, and what moving solids add (N, 3), m/s²."""
        blocks = torch.zeros(self.frame.count, 3, 3, dtype=self.frame.dtype, device=self.frame.torch_device)
        dragged = self.frame.unsorted().zero_()
        identity = torch.eye(3, dtype=blocks.dtype, device=blocks.device)
        density = runtime.to_torch(self.density)
        for contact in contacts:
            more, n = (contact.along - contact.across)[:, None], contact.normal
            blocks += contact.across[:, None, None] * identity + (more * n)[:, :, None] * n[:, None]
            dragged += contact.across[:, None] * contact.velocity + more * inner(n, contact.velocity) * n
        return blocks / density[:, None, None], dragged / density[:, None]

    def add_impulses(self, positions: Tensor, solution: Tensor | None, contacts: list[Contact]) -> None:
        """Add the impulses of friction and adhesion, if they are requested."""
        if self.frame.sums is None:
            return
        order = runtime.to_torch(self.frame.search.order).long()
        density = runtime.to_torch(self.density)[:, None]
        for contact in contacts:
            impulse = contact.pull[:, None] * contact.normal
            if solution is not None:
                relative, n = solution - contact.velocity, contact.normal
                more = (contact.along - contact.across)[:, None]
                impulse = impulse + self.time / density * (
                    contact.across[:, None] * relative + more * inner(n, relative) * n
                )
            self.frame.sums.add(contact.row, impulse, positions, order)

    def contacts(self, number: int, positions: wp.array) -> list[Contact]:
        """The solids and walls that the particles may be near."""
        frame, boundary, precision = self.frame, self.frame.boundary, self.frame.precision
        unturned, origin = precision.mat33(1, 0, 0, 0, 1, 0, 0, 0, 1), precision.vec3()
        corners, table, grid = boundary.inputs[:3], boundary.inputs[3], boundary.inputs[5:]
        found = []
        if boundary.walls is None:
            found.append(self.contact(WALLS, self.kernels.place_walls, positions, [unturned, origin, *corners, table]))
        if boundary.solid != NO_SOLID:
            inputs = [unturned, origin, *frame.solid, boundary.solid, table, *grid]
            found.append(self.contact(None, self.kernels.place_solid, positions, inputs))
        if frame.moving is None or self.steps is None:
            return found
        for k in range(len(boundary.bodies) + (boundary.walls is not None)):
            step = frame.moving.step(number, k)
            rotation, translation = self.steps.rotation[number, k], self.steps.translation[number, k]
            place = [precision.mat33(*rotation.flatten().tolist()), precision.vec3(*translation.tolist())]
            if k < len(boundary.bodies):
                inputs = [*place, None, None, None, VOLUME_MAP, table, *boundary.bodies[k][2:]]
                row = self.frame.sums.moving_row(k) if self.frame.sums is not None else 0
                found.append(self.contact(row, self.kernels.place_solid, positions, inputs, step.velocity))
            else:
                inputs = [*place, *(boundary.walls or [])]
                found.append(self.contact(WALLS, self.kernels.place_walls, positions, inputs, step.velocity))
        return found

    def contact(
        self, row: int | None, kernel: wp.Kernel, positions: wp.array, inputs: list[Any], velocity: Any = None
    ) -> Contact:
        """A contact, placed by a kernel; ``velocity`` gives that of the solid at points (N, 3)."""
        real, normals = self.frame.precision.real, self.frame.vectors()
        values = wp.zeros(self.frame.count, dtype=self.kernels.vec4, device=self.frame.device)
        factors = [real(self.coefficients["friction"]), real(self.time * self.coefficients["adhesion"])]
        self.frame.launch(kernel, [positions, *inputs, *factors], [values, normals])
        points, normal = (runtime.to_torch(value) for value in (positions, normals))
        moved = torch.zeros_like(points) if velocity is None else velocity(points)
        return Contact(row, normal, moved, *runtime.to_torch(values).unbind(dim=1))


def kinetic_energy(velocities: Tensor) -> Tensor:
    """Mean of particles with velocities (N, 3), J/kg, in double precision."""
    return 0.5 * velocities.double().square().sum() / len(velocities)


def inner(one: Tensor, other: Tensor) -> Tensor:
    """Scalar products (N, 1) of vectors (N, 3)."""
    return (one * other).sum(dim=1, keepdim=True)


def dot(one: Tensor, other: Tensor) -> Tensor:
    """The scalar product of all vectors, in double precision."""
    return (one * other).sum(dtype=torch.float64)


def times(matrices: Tensor, vectors: Tensor) -> Tensor:
    """Matrices (N, 3, 3) times vectors (N, 3)."""
    return (matrices * vectors[:, None]).sum(dim=2)


def inverse_of(matrices: Tensor) -> Tensor:
    """The inverses of symmetric matrices (N, 3, 3)."""
    rows = matrices.unbind(dim=1)
    adjugate = torch.stack([torch.linalg.cross(rows[(k + 1) % 3], rows[(k + 2) % 3]) for k in range(3)], dim=2)
    return adjugate / (rows[0] * adjugate[:, :, 0]).sum(dim=1)[:, None, None]
