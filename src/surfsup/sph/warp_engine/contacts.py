"""Collision handling solid by solid, as operations of torch: beside what moves, and where impulses are requested.

As ``native/sph/moving_collision.cpp``. Differentiable in the particles and in the poses. On a CPU only particles that
may be near are queried. On a GPU all are, so that the host need not wait to learn which they are, and no path is cut
where it enters a solid.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from surfsup.sdf import Surface
from surfsup.sph.clearance import CLEARANCE, ROUNDS, TOLERANCE, CollisionResult
from surfsup.sph.environment import Environment
from surfsup.sph.moving import FrameMotion
from surfsup.sph.rigid_steps import RigidStep
from surfsup.sph.warp_engine.crossing import MIN_SWEPT_PATH, entering, stop_crossings
from surfsup.sph.warp_engine.impulses import WALLS, ImpulseSums


@dataclass(frozen=True)
class Obstacle:
    """A solid as collision handling sees it.

    Attributes:
        surface: in its own frame, on the device of the particles.
        box: (2, 3) corners around one that moves, in its own frame, meters.
        start, end: places of one that moves before and after; None for one that stands still.
    """

    surface: Surface
    box: Tensor | None = None
    start: RigidStep | None = None
    end: RigidStep | None = None

    def distance(self, points: Tensor) -> Tensor:
        """Distance (N,) at world points (N, 3)."""
        return self.surface.distance(points if self.end is None else self.end.to_own(points))

    def distance_and_normal(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Distance (N,) and normal (N, 3) at world points (N, 3)."""
        if self.end is None:
            return self.surface.distance_and_normal(points)
        distance, normal = self.surface.distance_and_normal(self.end.to_own(points))
        return distance, normal @ self.end.rotation.T

    def velocity(self, points: Tensor) -> Tensor:
        """Velocity (N, 3) of the solid at world points (N, 3)."""
        return torch.zeros_like(points) if self.end is None else self.end.velocity(points)

    def stop(self, before: Tensor, positions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Positions (N, 3) on paths that end where they enter the solid, who (N,) was stopped and who may be near.

        In the frame of a solid its motion is part of a path.
        """
        stopped = torch.zeros_like(positions[:, 0], dtype=torch.bool)
        if self.start is None or self.end is None or self.box is None:
            if positions.device.type == "cpu":
                positions, rows = stop_crossings(before, positions, self.surface, None)
                if rows is not None:
                    stopped[rows] = True
            return positions, stopped, torch.ones_like(stopped)
        start, end = self.start.to_own(before), self.end.to_own(positions)
        with torch.no_grad():
            path = torch.linalg.vector_norm(end - start, dim=-1)
            outside = (self.box[0] - end).clamp(min=0) + (end - self.box[1]).clamp(min=0)
            room = torch.linalg.vector_norm(outside, dim=-1)
            near = ~(room > CLEARANCE)
            if positions.device.type != "cpu":
                return positions, stopped, near
            crossing = torch.nonzero(~(room > CLEARANCE + path) & (path > MIN_SWEPT_PATH * CLEARANCE))[:, 0]
            chosen, cut = entering(start[crossing], end[crossing], self.surface, CLEARANCE)
            rows = crossing[chosen]
            if len(rows) == 0:
                return positions, stopped, near
            stopped[rows] = True
        entry = self.end.to_world(start[rows] + cut[:, None] * (end[rows] - start[rows]))
        return positions.index_copy(0, rows, entry), stopped, near | stopped


@dataclass(frozen=True)
class Walls:
    """The walls of the container, which may move.

    Attributes:
        lower, upper: (3,) corners of the room for particles' centers, in the frame of the container, meters.
        place: of a container that moves after the frame, None for one that stands still.
    """

    lower: Tensor
    upper: Tensor
    place: RigidStep | None

    def contain(self, positions: Tensor, velocities: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Positions and velocities (N, 3) inside the container, and which particles (N,) were moved."""
        if self.place is None:
            return clamped(positions, velocities, self.lower, self.upper)
        place = self.place
        relative = (velocities - place.velocity(positions)) @ place.rotation
        own, relative, moved = clamped(place.to_own(positions), relative, self.lower, self.upper)
        new = place.to_world(own)
        new_velocities = relative @ place.rotation.T + place.velocity(new)
        return (
            torch.where(moved[:, None], new, positions),
            torch.where(moved[:, None], new_velocities, velocities),
            moved,
        )


def clamped(positions: Tensor, velocities: Tensor, lower: Tensor, upper: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Positions (N, 3) in a box, velocities (N, 3) without the parts that point out, and who (N,) was moved."""
    inside = torch.where(positions < lower, lower, torch.where(positions > upper, upper, positions))
    out = velocities * (inside - positions).detach() < 0
    return inside, torch.where(out, 0.0, velocities), (inside != positions).any(dim=-1)


class Contacts:
    """The solids and walls of an environment, and what they do to particles.

    Args:
        environment: with the motion of what moves.
        like: particles (N, 3), whose device and precision are used.
        sums: of the impulses; None where they are not requested.
    """

    def __init__(self, environment: Environment, like: Tensor, sums: ImpulseSums | None) -> None:
        self.obstacles = obstacles_of(environment, environment.motion, like)
        self.walls = walls_of(environment, environment.motion, like)
        self.sums = sums
        first = 0 if environment.surface is None else 1
        self.rows = [None if number < first else number - first for number in range(len(self.obstacles))]

    def contain(
        self, positions: Tensor, velocities: Tensor, particles: Tensor, only: Tensor | None = None
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Positions and velocities (K, 3) inside the container, and who (K,) was moved.

        Args:
            positions: (K, 3), meters.
            velocities: (K, 3), m/s.
            particles: (K,) their indices.
            only: (K, 1) which of them are regarded; all without it.
        """
        inside, slowed, moved = self.walls.contain(positions, velocities)
        if only is not None:
            inside, slowed = torch.where(only, inside, positions), torch.where(only, slowed, velocities)
        if self.sums is not None:
            self.sums.add(WALLS, velocities - slowed, inside, particles)
        return inside, slowed, moved

    def add(self, number: int, impulses: Tensor, positions: Tensor, particles: Tensor) -> None:
        """Add the impulses (K, 3) that an obstacle receives."""
        if self.sums is not None:
            row = self.rows[number]
            self.sums.add(None if row is None else self.sums.moving_row(row), impulses, positions, particles)

    def move_out(
        self, number: int, positions: Tensor, velocities: Tensor, particles: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Positions and velocities (K, 3) with clearance from an obstacle and without approach, and who was too near.

        Args:
            number: of the obstacle.
            positions: (K, 3), meters.
            velocities: (K, 3), m/s.
            particles: (K,) their indices.
        """
        obstacle = self.obstacles[number]
        distance, normal = obstacle.distance_and_normal(positions)
        depth = CLEARANCE - distance
        deep = (depth > TOLERANCE)[:, None]
        approach = ((velocities - obstacle.velocity(positions)) * normal).sum(dim=-1).clamp(max=0)
        projected = torch.where(deep, positions + depth[:, None] * normal, positions)
        slowed = torch.where(deep, velocities - approach[:, None] * normal, velocities)
        self.add(number, velocities - slowed, projected, particles)
        inside, contained, _ = self.contain(projected, slowed, particles, deep)
        return inside, contained, deep[:, 0]

    def take_along(
        self,
        number: int,
        before: Tensor,
        positions: Tensor,
        velocities: Tensor,
        particles: Tensor,
        only: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Positions and velocities (K, 3), where those inside an obstacle stay where they were and move with it.

        Args:
            number: of the obstacle.
            before: (K, 3) positions at the start of the step, meters.
            positions: (K, 3), meters.
            velocities: (K, 3), m/s.
            particles: (K,) their indices.
            only: (K,) which of them are regarded.
        """
        obstacle = self.obstacles[number]
        with torch.no_grad():
            inside = (only & (obstacle.distance(positions) < 0))[:, None]
        start = before
        if obstacle.start is not None and obstacle.end is not None:
            start = obstacle.end.to_world(obstacle.start.to_own(before))
        positions = torch.where(inside, start, positions)
        slowed = torch.where(inside, obstacle.velocity(start), velocities)
        self.add(number, velocities - slowed, positions, particles)
        back, contained, _ = self.contain(positions, slowed, particles, inside)
        return back, contained


def resolve_contacts(
    before: Tensor,
    positions: Tensor,
    velocities: Tensor,
    environment: Environment,
    sums: ImpulseSums | None = None,
) -> CollisionResult:
    """See :func:`surfsup.sph.collision.resolve_collisions`; differentiable.

    Args:
        before: (N, 3) positions at the start, meters.
        positions: (N, 3), meters.
        velocities: (N, 3), m/s.
        environment: container, solids and their motion.
        sums: to which impulses are added; None where they are not requested.
    """
    contacts = Contacts(environment, positions, sums)
    obstacles, everyone = contacts.obstacles, torch.arange(len(positions), device=positions.device)
    collided = torch.zeros_like(positions[:, 0], dtype=torch.bool)
    if environment.motion is None:  # walls that stand still end a path before a solid does
        positions, velocities, collided = contacts.contain(positions, velocities, everyone)
    near = []
    for obstacle in obstacles:
        positions, stopped, close = obstacle.stop(before, positions)
        collided = collided | stopped
        near.append(listed(close))
    positions, velocities, moved = contacts.contain(positions, velocities, everyone)
    collided = collided | moved
    projected = torch.zeros_like(collided)
    for _ in range(ROUNDS):
        projected = torch.zeros_like(collided)
        for number, rows in enumerate(near):
            if len(rows) == 0:
                continue
            new, new_speed, deep = contacts.move_out(number, positions[rows], velocities[rows], rows)
            positions, velocities = positions.index_copy(0, rows, new), velocities.index_copy(0, rows, new_speed)
            projected = projected.index_copy(0, rows, projected[rows] | deep)
        collided = collided | projected
        rows = listed(projected)
        if len(rows) == 0:
            return CollisionResult(positions, velocities, collided)
        near = [rows] * len(obstacles)
    stuck = listed(projected)
    for number in range(len(obstacles)):
        new, new_speed = contacts.take_along(
            number, before[stuck], positions[stuck], velocities[stuck], stuck, projected[stuck]
        )
        positions, velocities = positions.index_copy(0, stuck, new), velocities.index_copy(0, stuck, new_speed)
    return CollisionResult(positions, velocities, collided)


def resolve_collisions(
    before: Tensor,
    positions: Tensor,
    velocities: Tensor,
    environment: Environment,
    masses: np.ndarray | None = None,
) -> CollisionResult:
    """See :func:`surfsup.sph.collision.resolve_collisions`; differentiable. Adds the impulses that are requested."""
    sums = None if environment.impulses is None else ImpulseSums(environment, positions, masses)
    result = resolve_contacts(before, positions, velocities, environment, sums)
    if sums is not None:
        sums.finish()
    return result


def obstacles_of(environment: Environment, motion: FrameMotion | None, like: Tensor) -> list[Obstacle]:
    """What stands still, then what moves, for particles on a device."""
    obstacles = [] if environment.surface is None else [Obstacle(environment.surface)]
    if motion is None:
        return obstacles
    start, end = (motion.places(1).at(number).to(like) for number in (0, 1))
    for number, body in enumerate(motion.bodies):
        surface, box = body.surface_on(like.device), torch.from_numpy(body.box).to(like)
        obstacles.append(Obstacle(surface, box, start.of(number), end.of(number)))
    return obstacles


def walls_of(environment: Environment, motion: FrameMotion | None, like: Tensor) -> Walls:
    """The walls, for particles on a device."""
    lower, upper = environment.lower.to(like) + CLEARANCE, environment.upper.to(like) - CLEARANCE
    if motion is None or not motion.moves_container:
        return Walls(lower, upper, None)
    return Walls(lower, upper, motion.places(1).at(1).to(like).of(len(motion.bodies)))


def listed(mask: Tensor) -> Tensor:
    """The particles (K,) of a mask (N,); all of them on a GPU, where the host would wait to learn their number."""
    if mask.device.type == "cpu":
        return torch.nonzero(mask)[:, 0]
    return torch.arange(len(mask), device=mask.device)
