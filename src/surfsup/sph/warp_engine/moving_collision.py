"""Collision handling beside solids and walls that move, as operations of torch; as ``native/sph/moving_collision.cpp``.

Differentiable in the particles and in the poses. On a CPU only particles that may be near are queried. On a GPU all
are, so that the host need not wait to learn which they are, and no path is cut where it enters a solid.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from surfsup.sdf import Surface
from surfsup.sph.clearance import CLEARANCE, ROUNDS, TOLERANCE, CollisionResult
from surfsup.sph.environment import Environment
from surfsup.sph.moving import FrameMotion
from surfsup.sph.rigid_steps import RigidStep
from surfsup.sph.warp_engine.crossing import MIN_SWEPT_PATH, entering, stop_crossings


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


def resolve_moving_collisions(
    before: Tensor, positions: Tensor, velocities: Tensor, environment: Environment, motion: FrameMotion
) -> CollisionResult:
    """See :func:`surfsup.sph.collision.resolve_moving_collisions`; differentiable."""
    obstacles, walls = obstacles_of(environment, motion, positions), walls_of(environment, motion, positions)
    collided = torch.zeros_like(positions[:, 0], dtype=torch.bool)
    near = []
    for obstacle in obstacles:
        positions, stopped, close = obstacle.stop(before, positions)
        collided = collided | stopped
        near.append(listed(close))
    positions, velocities, moved = walls.contain(positions, velocities)
    collided = collided | moved
    projected = torch.zeros_like(collided)
    for _ in range(ROUNDS):
        projected = torch.zeros_like(collided)
        for obstacle, rows in zip(obstacles, near, strict=True):
            if len(rows) == 0:
                continue
            place, speed = positions[rows], velocities[rows]
            new, new_speed, deep = moved_out(obstacle, walls, place, speed)
            positions, velocities = positions.index_copy(0, rows, new), velocities.index_copy(0, rows, new_speed)
            projected = projected.index_copy(0, rows, projected[rows] | deep)
        collided = collided | projected
        rows = listed(projected)
        if len(rows) == 0:
            return CollisionResult(positions, velocities, collided)
        near = [rows] * len(obstacles)
    for obstacle in obstacles:
        with torch.no_grad():
            stuck = listed(projected)
            inside = (obstacle.distance(positions[stuck]) < 0) & projected[stuck]
        start = before[stuck]
        if obstacle.start is not None and obstacle.end is not None:
            # It stays where it was in the frame of the solid, and moves with it.
            start = obstacle.end.to_world(obstacle.start.to_own(start))
        back, slow, _ = walls.contain(start, obstacle.velocity(start))
        new = torch.where(inside[:, None], back, positions[stuck])
        new_speed = torch.where(inside[:, None], slow, velocities[stuck])
        positions, velocities = positions.index_copy(0, stuck, new), velocities.index_copy(0, stuck, new_speed)
    return CollisionResult(positions, velocities, collided)


def moved_out(obstacle: Obstacle, walls: Walls, positions: Tensor, velocities: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Positions and velocities (N, 3) with clearance from a solid and without approach, and who (N,) was too near."""
    distance, normal = obstacle.distance_and_normal(positions)
    depth = CLEARANCE - distance
    deep = depth > TOLERANCE
    wall = obstacle.velocity(positions)
    approach = ((velocities - wall) * normal).sum(dim=-1).clamp(max=0)
    projected = positions + depth[:, None] * normal
    inside, slowed, _ = walls.contain(projected, velocities - approach[:, None] * normal)
    return torch.where(deep[:, None], inside, positions), torch.where(deep[:, None], slowed, velocities), deep


def obstacles_of(environment: Environment, motion: FrameMotion, like: Tensor) -> list[Obstacle]:
    """What stands still, then what moves, for particles on a device."""
    obstacles = [] if environment.surface is None else [Obstacle(environment.surface)]
    start, end = (motion.places(1).at(number).to(like) for number in (0, 1))
    for number, body in enumerate(motion.bodies):
        surface, box = body.surface_on(like.device), torch.from_numpy(body.box).to(like)
        obstacles.append(Obstacle(surface, box, start.of(number), end.of(number)))
    return obstacles


def walls_of(environment: Environment, motion: FrameMotion, like: Tensor) -> Walls:
    """The walls, for particles on a device."""
    lower, upper = environment.lower.to(like) + CLEARANCE, environment.upper.to(like) - CLEARANCE
    place = motion.places(1).at(1).to(like).of(len(motion.bodies)) if motion.moves_container else None
    return Walls(lower, upper, place)


def listed(mask: Tensor) -> Tensor:
    """The particles (K,) of a mask (N,); all of them on a GPU, where the host would wait to learn their number."""
    if mask.device.type == "cpu":
        return torch.nonzero(mask)[:, 0]
    return torch.arange(len(mask), device=mask.device)
