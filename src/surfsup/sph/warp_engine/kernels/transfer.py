"""Between the caller's order of particles and that of cells, in Warp."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.sph.kernels import KERNEL_SUPPORT
from surfsup.warp_runtime import Precision


@cache
def transfer_kernels(precision: Precision) -> SimpleNamespace:
    """The kernels that sort particles by cell and return them to the caller's order."""
    real, vec3 = precision.real, precision.vec3
    module = f"surfsup.transfer.{precision.name}"
    support = real(KERNEL_SUPPORT)

    @wp.kernel(module=module, enable_backward=False)
    def predict_particles(
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        seconds: real,
        fall: vec3,
        predicted: wp.array(dtype=vec3),
    ):
        """Ballistic motion over a frame or a part of one."""
        i = wp.tid()
        predicted[i] = positions[i] + seconds * velocities[i] + fall

    @wp.kernel(module=module, enable_backward=False)
    def sort_particles(
        order: wp.array(dtype=int),
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        predicted: wp.array(dtype=vec3),
        distance: wp.array(dtype=real),
        normal: wp.array(dtype=vec3),
        plane: int,
        sorted_positions: wp.array(dtype=vec3),
        sorted_velocities: wp.array(dtype=vec3),
        sorted_predicted: wp.array(dtype=vec3),
        sorted_distance: wp.array(dtype=real),
        sorted_normal: wp.array(dtype=vec3),
        near_solid: wp.array(dtype=int),
    ):
        i = wp.tid()
        k = order[i]
        sorted_positions[i] = positions[k]
        sorted_velocities[i] = velocities[k]
        near = int(0)
        if plane == 1:
            sorted_predicted[i] = predicted[k]
            sorted_distance[i] = distance[k]
            sorted_normal[i] = normal[k]
            if distance[k] < support:
                near = 1
        near_solid[i] = near

    @wp.kernel(module=module, enable_backward=False)
    def finish_particles(
        order: wp.array(dtype=int),
        predicted: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        fallen: vec3,
        delta_position: wp.array(dtype=vec3),
        delta_velocity: wp.array(dtype=vec3),
        new_positions: wp.array(dtype=vec3),
        new_velocities: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        k = order[i]
        new_positions[k] = predicted[k] + delta_position[i]
        new_velocities[k] = velocities[k] + fallen + delta_velocity[i]

    @wp.kernel(module=module, enable_backward=False)
    def sort_adjoints(
        order: wp.array(dtype=int),
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        time: real,
        position_adjoint: wp.array(dtype=vec3),
        change: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        k = order[i]
        position_adjoint[i] = positions[k]
        change[i] = velocities[k] + time * positions[k]

    @wp.kernel(module=module, enable_backward=False)
    def unsort_adjoints(
        order: wp.array(dtype=int),
        position_adjoint: wp.array(dtype=vec3),
        velocity_adjoint: wp.array(dtype=vec3),
        predicted_adjoint: wp.array(dtype=vec3),
        distance_adjoint: wp.array(dtype=real),
        normal_adjoint: wp.array(dtype=vec3),
        plane: int,
        time: real,
        in_positions: wp.array(dtype=vec3),
        in_velocities: wp.array(dtype=vec3),
        in_distance: wp.array(dtype=real),
        in_normal: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        k = order[i]
        through_predicted = vec3()
        if plane == 1:
            through_predicted = predicted_adjoint[i]
            in_distance[k] = distance_adjoint[i]
            in_normal[k] = normal_adjoint[i]
        in_positions[k] = position_adjoint[i] + through_predicted
        in_velocities[k] = velocity_adjoint[i] + time * through_predicted

    return SimpleNamespace(
        kernels=[predict_particles, sort_particles, finish_particles, sort_adjoints, unsort_adjoints],
        predict_particles=predict_particles,
        sort_particles=sort_particles,
        finish_particles=finish_particles,
        sort_adjoints=sort_adjoints,
        unsort_adjoints=unsort_adjoints,
    )
