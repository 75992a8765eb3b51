"""The substeps of a frame by DFSPH in Warp, forward. The formulas are in :mod:`surfsup.sph.dfsph`."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.sph import dfsph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.warp_runtime import Precision


@cache
def substep_kernels(precision: Precision) -> SimpleNamespace:
    """The kernels of a substep in a precision."""
    real, vec3 = precision.real, precision.vec3
    module = f"surfsup.substeps.{precision.name}"
    scale = real(dfsph.GRADIENT_SCALE)
    shrink = real(1.0 / KERNEL_SUPPORT)
    one, zero, half, two, three = real(1.0), real(0.0), real(0.5), real(2.0), real(3.0)
    six, eight, nine = real(6.0), real(8.0), real(9.0)
    self_density, softening = real(dfsph.SELF_DENSITY), real(dfsph.VISCOSITY_SOFTENING)
    viscosity = real(dfsph.LAPLACIAN_FACTOR * dfsph.VISCOSITY * dfsph.GRADIENT_SCALE / KERNEL_SUPPORT)
    divergence_relaxation, density_relaxation = real(dfsph.DIVERGENCE_RELAXATION), real(dfsph.DENSITY_RELAXATION)
    deadband, min_squared_gradient = real(dfsph.DIVERGENCE_DEADBAND), real(dfsph.MIN_SQUARED_GRADIENT)
    max_density_error = real(dfsph.MAX_DENSITY_ERROR)

    @wp.func
    def kernel_value(q: real) -> real:
        """W(q) / W(0)."""
        outer, inner = wp.max(one - q, zero), wp.max(half - q, zero)
        return two * outer * outer * outer - eight * inner * inner * inner

    @wp.func
    def gradient_factor(q: real) -> real:
        """From the displacement in kernel supports to the kernel gradient: -W'(q) / (2 W(0) q)."""
        # Without a branch: which side a neighbor is on cannot be predicted.
        outer = wp.max(one - q, zero)
        return wp.where(q > half, three * outer * outer / wp.max(q, half), six - nine * q)

    @wp.kernel(module=module, enable_backward=False)
    def compute_pressures(
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        boundary: wp.array(dtype=real),
        boundary_gradient: wp.array(dtype=vec3),
        near_solid: wp.array(dtype=int),
        gravity: vec3,
        time: real,
        number: int,
        solid_approach: wp.array(dtype=real),
        moving: int,
        rest_density: wp.array(dtype=real),
        factors: wp.array2d(dtype=real),
        density: wp.array(dtype=real),
        density_rate: wp.array(dtype=real),
        density_gradient: wp.array(dtype=vec3),
        squared_gradient: wp.array(dtype=real),
        viscous: wp.array(dtype=vec3),
        pressure: wp.array(dtype=real),
    ):
        i = wp.tid()
        position, velocity = positions[i], velocities[i]
        value, squares, approach = real(0.0), real(0.0), real(0.0)
        gradient, friction = vec3(), vec3()
        for k in range(counts[i]):
            j = neighbors[i, k]
            r = (positions[j] - position) * shrink
            squared = wp.length_sq(r)
            q = wp.sqrt(squared)
            factor = gradient_factor(q)
            factors[i, k] = factor
            value += kernel_value(q)
            gradient += factor * r
            squares += factor * factor * squared
            rate = factor * wp.dot(r, velocities[j] - velocity)
            approach += rate
            friction += rate / (squared + softening) * r

        if moving == 1:
            approach += solid_approach[i]
        own_boundary = boundary_gradient[i]
        fluid_density = self_density * (one + value) + boundary[i]
        whole_gradient = scale * gradient + own_boundary
        own_rate = wp.dot(own_boundary, velocity + real(number) * time * gravity) - scale * approach
        if number == 0:
            rest = one
            if near_solid[i] == 1:
                rest = wp.max(fluid_density, one)
            rest_density[i] = rest
        stiffness = wp.length_sq(whole_gradient) + scale * scale * squares
        dfsph_factor = zero
        if stiffness > min_squared_gradient:
            dfsph_factor = one / stiffness
        density_error = wp.min(fluid_density - rest_density[i], max_density_error)
        divergence_source = divergence_relaxation * wp.max(own_rate, zero)
        remaining = own_rate - divergence_source
        density_source = (
            density_error / time
            + remaining
            - wp.clamp(remaining, -deadband, deadband)
            + time * wp.dot(own_boundary, gravity)
        )
        density[i] = fluid_density
        density_rate[i] = own_rate
        density_gradient[i] = whole_gradient
        squared_gradient[i] = squares
        viscous[i] = friction
        pressure[i] = dfsph_factor * (divergence_source + density_relaxation * wp.max(density_source, zero))

    @wp.kernel(module=module, enable_backward=False)
    def apply_pressures(
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        factors: wp.array2d(dtype=real),
        pressure: wp.array(dtype=real),
        density: wp.array(dtype=real),
        density_gradient: wp.array(dtype=vec3),
        viscous: wp.array(dtype=vec3),
        gravity: vec3,
        time: real,
        number: int,
        delta_velocity: wp.array(dtype=vec3),
        delta_position: wp.array(dtype=vec3),
        new_positions: wp.array(dtype=vec3),
        new_velocities: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        position, velocity = positions[i], velocities[i]
        push = vec3()
        for k in range(counts[i]):
            j = neighbors[i, k]
            push += pressure[j] * factors[i, k] * (positions[j] - position)
        removed = pressure[i] * density_gradient[i] + scale * shrink * push
        change = time * viscosity / density[i] * viscous[i] - removed
        delta = delta_velocity[i] + change
        delta_velocity[i] = delta
        delta_position[i] += time * delta
        new_velocity = velocity + change
        new_velocities[i] = new_velocity
        new_positions[i] = position + time * (new_velocity + real(number + 1) * time * gravity)

    @wp.kernel(module=module, enable_backward=False)
    def sum_velocity_differences(
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        difference: wp.array(dtype=vec3),
    ):
        """The kernel-weighted sum of neighbors' velocities minus the particle's, which only a network reads."""
        i = wp.tid()
        total = vec3()
        for k in range(counts[i]):
            j = neighbors[i, k]
            total += kernel_value(shrink * wp.length(positions[j] - positions[i])) * (velocities[j] - velocities[i])
        difference[i] = total

    return SimpleNamespace(
        kernels=[compute_pressures, apply_pressures, sum_velocity_differences],
        compute_pressures=compute_pressures,
        apply_pressures=apply_pressures,
        sum_velocity_differences=sum_velocity_differences,
        kernel_value=kernel_value,
        gradient_factor=gradient_factor,
    )
