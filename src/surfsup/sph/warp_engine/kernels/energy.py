"""Energy limiter in Warp, see :mod:`surfsup.sph.energy`, and its adjoint.

A mean over all particles decides, and it stays on the device: the kernels write which bound holds into ``choice``. 0 is
no bound, h the bound after h halvings, ``HALVINGS`` + 1 ballistic motion. Sums are taken in a fixed order, in double
precision.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.sph.energy_bound import HALVINGS, MAX_DELTA_VELOCITY
from surfsup.warp_runtime import Precision

FOLD = 64  # partial sums that one thread adds up


@cache
def energy_kernels(precision: Precision) -> SimpleNamespace:
    """The kernels of the energy limiter in a precision."""
    real, vec3 = precision.real, precision.vec3
    module = f"surfsup.energy.{precision.name}"
    half, one, tiny, max_delta = real(0.5), real(1.0), real(1e-9), real(MAX_DELTA_VELOCITY)
    halvings, fold = wp.constant(HALVINGS), wp.constant(FOLD)
    ballistic_choice = wp.constant(HALVINGS + 1)

    @wp.func
    def bound_of(choice: int) -> real:
        bound = max_delta
        for _ in range(choice):
            bound = bound * half
        return bound

    @wp.func
    def kept_fraction(delta_velocity: vec3, choice: int) -> real:
        """The factor, at most one, that shortens a change of velocity to the bound."""
        return wp.min(bound_of(choice) / wp.max(wp.length(delta_velocity), tiny), one)

    @wp.func
    def gain_of(old_position: vec3, old_velocity: vec3, position: vec3, velocity: vec3, gravity: vec3) -> wp.float64:
        """Mechanical energy that a particle gains, J/kg."""
        kinetic = half * wp.dot(velocity - old_velocity, velocity + old_velocity)
        return wp.float64(kinetic - wp.dot(position - old_position, gravity))

    @wp.kernel(module=module, enable_backward=False)
    def sum_gains(
        old_positions: wp.array(dtype=vec3),
        old_velocities: wp.array(dtype=vec3),
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        gravity: vec3,
        sums: wp.array2d(dtype=wp.float64),
    ):
        """The gain of the frame, in parts."""
        part = wp.tid()
        total = wp.float64(0.0)
        for i in range(part, positions.shape[0], sums.shape[1]):
            total += gain_of(old_positions[i], old_velocities[i], positions[i], velocities[i], gravity)
        sums[0, part] = total

    @wp.kernel(module=module, enable_backward=False)
    def sum_limited_gains(
        old_positions: wp.array(dtype=vec3),
        old_velocities: wp.array(dtype=vec3),
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        seconds: real,
        gravity: vec3,
        fall: vec3,
        choice: wp.array(dtype=int),
        sums: wp.array2d(dtype=wp.float64),
    ):
        """The gain of the frame under each bound, in parts, where it is needed."""
        halving, part = wp.tid()
        if choice[0] > 0:
            total = wp.float64(0.0)
            for i in range(part, positions.shape[0], sums.shape[1]):
                predicted = old_positions[i] + seconds * old_velocities[i] + fall
                falling = old_velocities[i] + seconds * gravity
                delta_velocity, delta_position = velocities[i] - falling, positions[i] - predicted
                fraction = kept_fraction(delta_velocity, halving + 1)
                position, velocity = predicted + fraction * delta_position, falling + fraction * delta_velocity
                total += gain_of(old_positions[i], old_velocities[i], position, velocity, gravity)
            sums[halving, part] = total

    @wp.kernel(module=module, enable_backward=False)
    def fold_sums(sums: wp.array2d(dtype=wp.float64), folded: wp.array2d(dtype=wp.float64)):
        row, part = wp.tid()
        total = wp.float64(0.0)
        for k in range(fold):
            at = part * fold + k
            if at < sums.shape[1]:
                total += sums[row, at]
        folded[row, part] = total

    @wp.kernel(module=module, enable_backward=False)
    def sum_work(work: wp.array(dtype=real), sums: wp.array2d(dtype=wp.float64)):
        """What moving solids did to the particles, in parts."""
        part = wp.tid()
        total = wp.float64(0.0)
        for i in range(part, work.shape[0], sums.shape[1]):
            total += wp.float64(work[i])
        sums[0, part] = total

    @wp.kernel(module=module, enable_backward=False)
    def allow_work(folded: wp.array2d(dtype=wp.float64), count: int, max_gain: wp.array(dtype=wp.float64)):
        """Add the mean work to the largest gain."""
        total = wp.float64(0.0)
        for k in range(fold):
            total += folded[0, k]
        max_gain[0] = max_gain[0] + total / wp.float64(count)

    @wp.kernel(module=module, enable_backward=False)
    def choose_whether_to_limit(
        folded: wp.array2d(dtype=wp.float64),
        count: int,
        max_gain: wp.array(dtype=wp.float64),
        choice: wp.array(dtype=int),
    ):
        total = wp.float64(0.0)
        for k in range(fold):
            total += folded[0, k]
        chosen = int(0)
        if total / wp.float64(count) > max_gain[0]:
            chosen = 1
        choice[0] = chosen

    @wp.kernel(module=module, enable_backward=False)
    def choose_bound(
        folded: wp.array2d(dtype=wp.float64),
        count: int,
        max_gain: wp.array(dtype=wp.float64),
        choice: wp.array(dtype=int),
    ):
        if choice[0] > 0:
            chosen = int(ballistic_choice)
            for above in range(halvings):
                halving = halvings - 1 - above
                total = wp.float64(0.0)
                for k in range(fold):
                    total += folded[halving, k]
                if total / wp.float64(count) <= max_gain[0]:
                    chosen = halving + 1
            choice[0] = chosen

    @wp.kernel(module=module, enable_backward=False)
    def apply_bound(
        old_positions: wp.array(dtype=vec3),
        old_velocities: wp.array(dtype=vec3),
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        seconds: real,
        gravity: vec3,
        fall: vec3,
        choice: wp.array(dtype=int),
        new_positions: wp.array(dtype=vec3),
        new_velocities: wp.array(dtype=vec3),
    ):
        i = wp.tid()
        chosen = choice[0]
        if chosen == 0:
            new_positions[i] = positions[i]
            new_velocities[i] = velocities[i]
        else:
            predicted = old_positions[i] + seconds * old_velocities[i] + fall
            falling = old_velocities[i] + seconds * gravity
            delta_velocity, delta_position = velocities[i] - falling, positions[i] - predicted
            fraction = real(0.0)
            if chosen <= halvings:
                fraction = kept_fraction(delta_velocity, chosen)
            new_positions[i] = predicted + fraction * delta_position
            new_velocities[i] = falling + fraction * delta_velocity

    @wp.kernel(module=module, enable_backward=False)
    def bound_adjoint(
        old_positions: wp.array(dtype=vec3),
        old_velocities: wp.array(dtype=vec3),
        positions: wp.array(dtype=vec3),
        velocities: wp.array(dtype=vec3),
        seconds: real,
        gravity: vec3,
        fall: vec3,
        choice: wp.array(dtype=int),
        of_positions: wp.array(dtype=vec3),
        of_velocities: wp.array(dtype=vec3),
        in_old_positions: wp.array(dtype=vec3),
        in_old_velocities: wp.array(dtype=vec3),
        in_positions: wp.array(dtype=vec3),
        in_velocities: wp.array(dtype=vec3),
    ):
        """Derivatives from those in the limited frame. The choice of the bound is constant."""
        i = wp.tid()
        of_position, of_velocity = of_positions[i], of_velocities[i]
        in_position, in_velocity = vec3(), vec3()
        chosen = choice[0]
        if chosen == 0:
            in_position = in_position + of_position
            in_velocity = in_velocity + of_velocity
        elif chosen <= halvings:
            predicted = old_positions[i] + seconds * old_velocities[i] + fall
            falling = old_velocities[i] + seconds * gravity
            delta_velocity, delta_position = velocities[i] - falling, positions[i] - predicted
            fraction = kept_fraction(delta_velocity, chosen)
            in_position = fraction * of_position
            in_velocity = fraction * of_velocity
            if fraction < one:
                of_fraction = wp.dot(of_position, delta_position) + wp.dot(of_velocity, delta_velocity)
                in_velocity -= (of_fraction * fraction / wp.length_sq(delta_velocity)) * delta_velocity
        in_positions[i] = in_position
        in_velocities[i] = in_velocity
        in_predicted = of_position - in_position
        in_old_positions[i] = in_predicted
        in_old_velocities[i] = seconds * in_predicted + of_velocity - in_velocity

    return SimpleNamespace(
        kernels=[
            sum_work,
            allow_work,
            sum_gains,
            sum_limited_gains,
            fold_sums,
            choose_whether_to_limit,
            choose_bound,
            apply_bound,
            bound_adjoint,
        ],
        sum_work=sum_work,
        allow_work=allow_work,
        sum_gains=sum_gains,
        sum_limited_gains=sum_limited_gains,
        fold_sums=fold_sums,
        choose_whether_to_limit=choose_whether_to_limit,
        choose_bound=choose_bound,
        apply_bound=apply_bound,
        bound_adjoint=bound_adjoint,
    )
