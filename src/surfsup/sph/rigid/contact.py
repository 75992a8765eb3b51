"""Contacts of rigid bodies with walls, solids and each other: sequential impulses on signed distances.

E. Catto, "Iterative dynamics with temporal coherence", Game Developers Conference, 2005. Contacts do not rebound; they
have Coulomb friction, along two tangents each for itself. A contact lets its points approach by no more than the gap
that is left, so that nothing enters anything else in a frame, and moves what is inside out again within a few.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from surfsup.scene.pose import Pose
from surfsup.scene.solids import CONTAINER
from surfsup.sph.rigid.body import Body, BodyState

FRICTION = 0.3
ITERATIONS = 12
MAX_CONTACTS = 12  # of a pair
RECOVERY = 0.2  # of a penetration that a frame removes
MIN_RESPONSE = 1e-9  # of the largest response to an impulse, below which a contact cannot move its body


@dataclass(frozen=True)
class Obstacle:
    """Something that a body can touch.

    Attributes:
        distance_and_normal: signed distance (N,) and normal (N, 3) at points (N, 3) of the world.
        velocity: (N, 3) at points (N, 3), m/s; of a rigid body those of ``body``.
        body: number of the rigid body that it is, or None.
        name: of the surface.
    """

    distance_and_normal: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    velocity: Callable[[np.ndarray], np.ndarray] | None = None
    body: int | None = None
    name: str = CONTAINER


def at_rest(points: np.ndarray) -> np.ndarray:
    """The velocity of what stands still."""
    return np.zeros_like(points)


def velocity_between(start: Pose, end: Pose, time: float) -> Callable[[np.ndarray], np.ndarray]:
    """The mean velocity of the points of a solid that moves from ``start`` to ``end`` in ``time`` seconds."""
    return lambda points: (end.apply(start.to_own(points)) - points) / time


class Contacts:
    """The contacts of some bodies in a frame.

    Args:
        bodies: the bodies.
        states: with the velocities that they would have without contacts.
        obstacles: what they may touch, bodies included.
        time: of the frame, seconds.

    Attributes:
        velocity, spin: (B, 3) of the bodies, m/s and rad/s.
    """

    def __init__(
        self, bodies: Sequence[Body], states: Sequence[BodyState], obstacles: Sequence[Obstacle], time: float
    ) -> None:
        self.velocity = np.array([state.velocity for state in states])
        self.spin = np.array([state.angular_velocity for state in states])
        self._bodies, self._states = bodies, states
        self._rows: list[np.ndarray] = []  # (3, 6 B) of each contact: normal and two tangents by velocities of bodies
        self._allowed: list[np.ndarray] = []  # (3,) least normal velocity, m/s, and the obstacle's along the tangents
        centers = [body.center(state.pose) for body, state in zip(bodies, states, strict=True)]
        for number, (body, state) in enumerate(zip(bodies, states, strict=True)):
            points = state.pose.apply(body.points)
            reach = np.linalg.norm(state.velocity) + np.linalg.norm(state.angular_velocity) * body.radius
            for obstacle in obstacles:
                if obstacle.body == number or obstacle.name in body.passes:
                    continue
                distance, normal = obstacle.distance_and_normal(points)
                speed = np.zeros_like(points) if obstacle.velocity is None else obstacle.velocity(points)
                fastest = float(reach) + float(np.linalg.norm(speed, axis=1).max())
                if obstacle.body is not None:
                    fastest += float(np.linalg.norm(states[obstacle.body].velocity))
                for k in chosen(points, distance, time * fastest + 1e-3 * body.radius):
                    axes = frame_of(normal[k])
                    row = np.zeros((3, len(bodies), 6))
                    row[:, number] = np.concatenate([axes, np.cross(points[k] - centers[number], axes)], axis=1)
                    if obstacle.body is not None:
                        arm = points[k] - centers[obstacle.body]
                        row[:, obstacle.body] = -np.concatenate([axes, np.cross(arm, axes)], axis=1)
                    depth = float(distance[k])
                    least = -depth / time if depth > 0 else -RECOVERY * depth / time
                    self._rows.append(row.reshape(3, -1))
                    self._allowed.append(axes @ speed[k] + (least, 0, 0))

    def solve(self) -> None:
        """Change the velocities until no contact closes faster than it may: projected Gauss-Seidel."""
        if not self._rows:
            return
        rows, allowed = np.concatenate(self._rows), np.concatenate(self._allowed)
        inverse = np.zeros((rows.shape[1], rows.shape[1]))
        for number, (body, state) in enumerate(zip(self._bodies, self._states, strict=True)):
            own = slice(6 * number, 6 * number + 6)
            inverse[own, own] = body.inverse_mass(state.pose)
        velocities = np.concatenate([self.velocity, self.spin], axis=1).reshape(-1)
        missing = allowed - rows @ velocities
        if (missing[::3] <= 0).all():
            return
        response = rows @ inverse @ rows.T
        # Nothing moves a body on an axle along the axle: such a contact stays as it is.
        diagonal, impulses = np.diag(response), np.zeros(len(rows))
        scale = np.divide(1, diagonal, out=np.zeros_like(diagonal), where=diagonal > MIN_RESPONSE * diagonal.max())
        for _ in range(ITERATIONS):
            for k in range(len(rows)):
                value = impulses[k] + scale[k] * (missing[k] - response[k] @ impulses)
                limit = FRICTION * impulses[k - k % 3]
                impulses[k] = max(0.0, value) if k % 3 == 0 else min(limit, max(-limit, value))
        after = (velocities + inverse @ (rows.T @ impulses)).reshape(-1, 6)
        self.velocity, self.spin = after[:, :3], after[:, 3:]


def frame_of(normal: np.ndarray) -> np.ndarray:
    """The ``normal`` (3,) and two unit vectors across it, (3, 3)."""
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    across = across / max(1e-9, float(np.linalg.norm(across)))
    return np.stack([normal, across, np.cross(normal, across)])


def chosen(points: np.ndarray, distance: np.ndarray, limit: float) -> list[int]:
    """Indices of at most MAX_CONTACTS of the ``points`` (N, 3) nearer than ``limit``: the nearest, then far apart."""
    near = np.flatnonzero(distance < limit)
    if len(near) <= MAX_CONTACTS:
        return near.tolist()
    found = [int(near[distance[near].argmin()])]
    apart = np.full(len(near), np.inf)
    while len(found) < MAX_CONTACTS:
        apart = np.minimum(apart, np.linalg.norm(points[near] - points[found[-1]], axis=1))
        found.append(int(near[apart.argmax()]))
    return found
