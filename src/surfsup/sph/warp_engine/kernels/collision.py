"""Collision handling in Warp, see :mod:`surfsup.sph.collision`, and its adjoint.

Only listed particles are projected out of the solid. The list has a fixed capacity, so that its length need not be
known to the host; rows beyond its length are left out.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.sph.clearance import CLEARANCE, LIPSCHITZ_BOUND, TOLERANCE
from surfsup.warp_runtime import Precision


@cache
def collision_kernels(precision: Precision) -> SimpleNamespace:
    """The kernels of collision handling in a precision."""
    real, vec3 = precision.real, precision.vec3
    module = f"surfsup.collision.{precision.name}"
    clearance, tolerance, zero = real(CLEARANCE), real(TOLERANCE), real(0.0)
    lipschitz_bound = real(LIPSCHITZ_BOUND)

    @wp.func
    def contained(position: vec3, lower: vec3, upper: vec3) -> vec3:
        """The nearest position with clearance from the walls; NaN stays NaN."""
        inside = position
        for axis in range(3):
            if position[axis] < lower[axis] + clearance:
                inside[axis] = lower[axis] + clearance
            if position[axis] > upper[axis] - clearance:
                inside[axis] = upper[axis] - clearance
        return inside

    @wp.func
    def slowed_by_walls(velocity: vec3, moved: vec3) -> vec3:
        """The velocity without the parts that point out of the walls which moved the particle."""
        slowed = velocity
        for axis in range(3):
            if velocity[axis] * moved[axis] < zero:
                slowed[axis] = zero
        return slowed

    @wp.func
    def free_axes(moved: vec3, adjoint: vec3) -> vec3:
        """The adjoint along the axes where no wall moved the particle."""
        kept = adjoint
        for axis in range(3):
            if moved[axis] != zero:
                kept[axis] = zero
        return kept

    @wp.func
    def unslowed_axes(velocity: vec3, moved: vec3, adjoint: vec3) -> vec3:
        """The adjoint along the axes where no wall removed velocity."""
        kept = adjoint
        for axis in range(3):
            if velocity[axis] * moved[axis] < zero:
                kept[axis] = zero
        return kept

    @wp.kernel(module=module, enable_backward=False)
    def clamp_to_container(
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        lower: vec3,
        upper: vec3,
        new_positions: wp.array(dtype=vec3),
        new_velocities: wp.array(dtype=vec3),
        collided: wp.array(dtype=wp.bool),
    ):
        i = wp.tid()
        position = positions[i]
        inside = contained(position, lower, upper)
        moved = inside - position
        new_positions[i] = inside
        new_velocities[i] = slowed_by_walls(velocities[i], moved)
        collided[i] = moved[0] != zero or moved[1] != zero or moved[2] != zero

    @wp.kernel(module=module, enable_backward=False)
    def clamp_adjoint(
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        lower: vec3,
        upper: vec3,
        of_positions: wp.array(dtype=vec3),
        of_velocities: wp.array(dtype=vec3),
        in_positions: wp.array(dtype=vec3),
        in_velocities: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        moved = contained(positions[i], lower, upper) - positions[i]
        in_positions[i] = free_axes(moved, of_positions[i])
        in_velocities[i] = unslowed_axes(velocities[i], moved, of_velocities[i])

    @wp.kernel(module=module, enable_backward=False)
    def list_near(
        positions: wp.array(dtype=vec3),
        query_positions: wp.array(dtype=vec3),
        query_distance: wp.array(dtype=real),
        near: wp.array(dtype=int),
        length: wp.array(dtype=int),
    ):
        """List the particles that may have come closer to the solid than the clearance since the last query."""
        i = wp.tid()
        path = wp.length(positions[i] - query_positions[i])
        if not (lipschitz_bound * path < query_distance[i] - clearance):
            row = wp.atomic_add(length, 0, 1)
            if row < near.shape[0]:
                near[row] = i

    @wp.kernel(module=module, enable_backward=False)
    def gather(
        near: wp.array(dtype=int),
        length: wp.array(dtype=int),
        positions: wp.array(dtype=vec3),
        points: wp.array(dtype=vec3),
    ):
        row = wp.tid()
        point = vec3()
        if row < length[0]:
            point = positions[near[row]]
        points[row] = point

    @wp.kernel(module=module, enable_backward=False)
    def project(
        near: wp.array(dtype=int),
        length: wp.array(dtype=int),
        distance: wp.array(dtype=real),
        normal: wp.array(dtype=vec3),
        lower: vec3,
        upper: vec3,
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        collided: wp.array(dtype=wp.bool),
        moved: wp.array(dtype=int),
        moved_length: wp.array(dtype=int),
    ):
        """Move the listed particles that are too close along the normal, in place, and list them."""
        row = wp.tid()
        if row < length[0]:
            depth = clearance - distance[row]
            if depth > tolerance:
                i = near[row]
                outward, velocity = normal[row], velocities[i]
                projected = positions[i] + depth * outward
                slowed = velocity - wp.min(wp.dot(velocity, outward), zero) * outward
                inside = contained(projected, lower, upper)
                positions[i] = inside
                velocities[i] = slowed_by_walls(slowed, inside - projected)
                collided[i] = True
                moved[wp.atomic_add(moved_length, 0, 1)] = i

    @wp.kernel(module=module, enable_backward=False)
    def project_adjoint(
        near: wp.array(dtype=int),
        length: wp.array(dtype=int),
        distance: wp.array(dtype=real),
        normal: wp.array(dtype=vec3),
        lower: vec3,
        upper: vec3,
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        in_positions: wp.array(dtype=vec3),
        in_velocities: wp.array(dtype=vec3),
        in_distance: wp.array(dtype=real),
        in_normal: wp.array(dtype=vec3),
    ):
        """Derivatives in the state before, in place of those in the state after."""
        row = wp.tid()
        of_distance, of_normal = real(0.0), vec3()
        if row < length[0]:
            depth = clearance - distance[row]
            if depth > tolerance:
                i = near[row]
                outward, velocity = normal[row], velocities[i]
                projected = positions[i] + depth * outward
                approach = wp.dot(velocity, outward)
                slowed = velocity - wp.min(approach, zero) * outward
                moved = contained(projected, lower, upper) - projected
                of_position = free_axes(moved, in_positions[i])
                of_velocity = unslowed_axes(slowed, moved, in_velocities[i])
                of_distance = -wp.dot(of_position, outward)
                of_normal = depth * of_position
                if approach < zero:
                    along = wp.dot(of_velocity, outward)
                    of_normal -= approach * of_velocity + along * velocity
                    of_velocity -= along * outward
                in_positions[i] = of_position
                in_velocities[i] = of_velocity
        in_distance[row] = of_distance
        in_normal[row] = of_normal

    @wp.kernel(module=module, enable_backward=False)
    def return_stuck(
        near: wp.array(dtype=int),
        length: wp.array(dtype=int),
        distance: wp.array(dtype=real),
        before: wp.array(dtype=vec3),
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
    ):
        """Return the listed particles that are still inside to where they were, in place."""
        row = wp.tid()
        if row < length[0] and distance[row] < zero:
            positions[near[row]] = before[near[row]]
            velocities[near[row]] = vec3()

    @wp.kernel(module=module, enable_backward=False)
    def return_adjoint(
        near: wp.array(dtype=int),
        length: wp.array(dtype=int),
        distance: wp.array(dtype=real),
        in_before: wp.array(dtype=vec3),
        in_positions: wp.array(dtype=vec3),
        in_velocities: wp.array(dtype=vec3),
    ):
        """Derivatives in the state before, in place of those in the state after."""
        row = wp.tid()
        if row < length[0] and distance[row] < zero:
            in_before[near[row]] = in_positions[near[row]]
            in_positions[near[row]] = vec3()
            in_velocities[near[row]] = vec3()

    return SimpleNamespace(
        kernels=[
            clamp_to_container,
            clamp_adjoint,
            list_near,
            gather,
            project,
            project_adjoint,
            return_stuck,
            return_adjoint,
        ],
        clamp_to_container=clamp_to_container,
        clamp_adjoint=clamp_adjoint,
        list_near=list_near,
        gather=gather,
        project=project,
        project_adjoint=project_adjoint,
        return_stuck=return_stuck,
        return_adjoint=return_adjoint,
    )
