"""The adjoint of a substep in Warp, by hand.

Every sum over neighbors is antisymmetric or symmetric in the pair. So a particle gathers the derivatives of its own
sums and of its neighbors' sums over one list, and nothing is added to another particle's memory.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.sph import dfsph
from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.sph.warp_engine.kernels.substeps import substep_kernels
from surfsup.warp_runtime import Precision


@cache
def adjoint_kernels(precision: Precision) -> SimpleNamespace:
    """The kernels of a substep's backward pass in a precision."""
    real, vec3 = precision.real, precision.vec3
    module = f"surfsup.adjoint.{precision.name}"
    scale = real(dfsph.GRADIENT_SCALE)
    shrink = real(1.0 / KERNEL_SUPPORT)
    one, zero, half, two, three, nine = real(1.0), real(0.0), real(0.5), real(2.0), real(3.0), real(9.0)
    self_density, softening = real(dfsph.SELF_DENSITY), real(dfsph.VISCOSITY_SOFTENING)
    viscosity = real(dfsph.LAPLACIAN_FACTOR * dfsph.VISCOSITY * dfsph.GRADIENT_SCALE / KERNEL_SUPPORT)
    divergence_relaxation, density_relaxation = real(dfsph.DIVERGENCE_RELAXATION), real(dfsph.DENSITY_RELAXATION)
    deadband, min_squared_gradient = real(dfsph.DIVERGENCE_DEADBAND), real(dfsph.MIN_SQUARED_GRADIENT)
    max_density_error, tiny = real(dfsph.MAX_DENSITY_ERROR), real(1e-6)
    gradient_factor = substep_kernels(precision).gradient_factor

    @wp.func
    def factor_slope(q: real) -> real:
        """The derivative of ``gradient_factor`` over q, finite where particles meet."""
        inverse = one / wp.max(q, tiny)
        bounded = wp.min(inverse, two)
        return wp.where(q > half, three * (one - bounded * bounded) * bounded, -nine * inverse)

    @wp.kernel(module=module, enable_backward=False)
    def pressure_adjoint(
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        boundary_gradient: wp.array(dtype=vec3),
        near_solid: wp.array(dtype=int),
        rest_density: wp.array(dtype=real),
        density: wp.array(dtype=real),
        density_rate: wp.array(dtype=real),
        density_gradient: wp.array(dtype=vec3),
        squared_gradient: wp.array(dtype=real),
        viscous: wp.array(dtype=vec3),
        pressure: wp.array(dtype=real),
        gravity: vec3,
        time: real,
        number: int,
        change: wp.array(dtype=vec3),
        rest_adjoint: wp.array(dtype=real),
        own_velocity: wp.array(dtype=vec3),
        of_value: wp.array(dtype=real),
        of_gradient: wp.array(dtype=vec3),
        of_squares: wp.array(dtype=real),
        of_approach: wp.array(dtype=real),
        of_friction: wp.array(dtype=vec3),
        boundary_adjoint: wp.array(dtype=real),
        boundary_gradient_adjoint: wp.array(dtype=vec3),
    ):
        """Derivatives of what a particle's own sums are used for; the sums themselves follow in ``motion_adjoint``."""
        i = wp.tid()
        position = positions[i]
        changed = change[i]
        towards = real(0.0)
        for k in range(counts[i]):
            j = neighbors[i, k]
            r = (positions[j] - position) * shrink
            factor = gradient_factor(wp.length(r))
            towards += factor * wp.dot(change[j], r)
        gradient = density_gradient[i]
        of_pressure = scale * towards - wp.dot(changed, gradient)
        gradient_adjoint = -pressure[i] * changed

        fluid_density, own_boundary = density[i], boundary_gradient[i]
        of_friction[i] = time * viscosity / fluid_density * changed
        density_adjoint = -time * viscosity * wp.dot(viscous[i], changed) / (fluid_density * fluid_density)

        stiffness = wp.length_sq(gradient) + scale * scale * squared_gradient[i]
        rate = density_rate[i]
        divergence_source = divergence_relaxation * wp.max(rate, zero)
        remaining = rate - divergence_source
        compression = fluid_density - rest_density[i]
        density_source = (
            wp.min(compression, max_density_error) / time
            + remaining
            - wp.clamp(remaining, -deadband, deadband)
            + time * wp.dot(own_boundary, gravity)
        )
        squares_adjoint, rate_adjoint = real(0.0), real(0.0)
        gradient_of_boundary = vec3()
        if stiffness > min_squared_gradient:
            source = divergence_source + density_relaxation * wp.max(density_source, zero)
            of_source = of_pressure / stiffness
            of_stiffness = -of_source * source / stiffness
            gradient_adjoint += two * of_stiffness * gradient
            squares_adjoint = scale * scale * of_stiffness
            of_divergence = of_source
            if density_source > zero:
                of_density_source = density_relaxation * of_source
                if compression < max_density_error:
                    density_adjoint += of_density_source / time
                    rest_adjoint[i] = rest_adjoint[i] - of_density_source / time
                if wp.abs(remaining) > deadband:
                    rate_adjoint += of_density_source
                    of_divergence -= of_density_source
                gradient_of_boundary += time * of_density_source * gravity
            if rate > zero:
                rate_adjoint += divergence_relaxation * of_divergence
        if number == 0 and near_solid[i] == 1 and fluid_density > one:
            density_adjoint += rest_adjoint[i]

        own_velocity[i] = changed + rate_adjoint * own_boundary
        of_value[i] = self_density * density_adjoint
        of_gradient[i] = scale * gradient_adjoint
        of_squares[i] = two * squares_adjoint
        of_approach[i] = -scale * rate_adjoint
        boundary_adjoint[i] = density_adjoint
        boundary_gradient_adjoint[i] = (
            gradient_of_boundary + gradient_adjoint + rate_adjoint * (velocities[i] + real(number) * time * gravity)
        )

    @wp.kernel(module=module, enable_backward=False)
    def motion_adjoint(
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        neighbors: wp.array2d(dtype=int),
        counts: wp.array(dtype=int),
        pressure: wp.array(dtype=real),
        change: wp.array(dtype=vec3),
        own_velocity: wp.array(dtype=vec3),
        of_value: wp.array(dtype=real),
        of_gradient: wp.array(dtype=vec3),
        of_squares: wp.array(dtype=real),
        of_approach: wp.array(dtype=real),
        of_friction: wp.array(dtype=vec3),
        of_boundary: wp.array(dtype=vec3),
        position_adjoint: wp.array(dtype=vec3),
        earlier: real,
        new_position_adjoint: wp.array(dtype=vec3),
        new_change: wp.array(dtype=vec3),
    ):
        """Derivatives in positions at the substep's start, and in the change of velocity in the substep before.

        A change of velocity moves the particle, too: its derivative is that in the velocity plus a substep's time that
        in the position.
        """
        i = wp.tid()
        position, velocity = positions[i], velocities[i]
        own_pressure, own_change = scale * pressure[i], scale * change[i]
        value, gradient, squares = of_value[i], of_gradient[i], of_squares[i]
        approach, friction = of_approach[i], of_friction[i]
        in_position, in_velocity = vec3(), vec3()
        for k in range(counts[i]):
            j = neighbors[i, k]
            r = (positions[j] - position) * shrink
            squared = wp.length_sq(r)
            q = wp.sqrt(squared)
            if q < one:
                factor = gradient_factor(q)
                relative = velocities[j] - velocity
                damping = one / (squared + softening)
                pair_friction = friction - of_friction[j]
                rate = factor * wp.dot(r, relative)
                along = damping * wp.dot(pair_friction, r)
                of_relative = approach + of_approach[j] + along
                # Derivative in the kernel gradient, factor * r.
                in_kernel = (
                    gradient
                    - of_gradient[j]
                    - pressure[j] * own_change
                    + own_pressure * change[j]
                    + ((squares + of_squares[j]) * factor) * r
                    + of_relative * relative
                )
                radial = (
                    factor_slope(q) * wp.dot(in_kernel, r)
                    - two * factor * (value + of_value[j])
                    - two * damping * along * rate
                )
                in_position += factor * in_kernel + radial * r + (rate * damping) * pair_friction
                in_velocity += (of_relative * factor) * r
        in_position = position_adjoint[i] + of_boundary[i] - shrink * in_position
        new_position_adjoint[i] = in_position
        new_change[i] = own_velocity[i] - in_velocity + earlier * in_position

    return SimpleNamespace(
        kernels=[pressure_adjoint, motion_adjoint],
        pressure_adjoint=pressure_adjoint,
        motion_adjoint=motion_adjoint,
    )
