"""The rigid bodies of a scene, advanced frame by frame beside the water."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from surfsup.errors import InputError
from surfsup.scene import Scene
from surfsup.scene.pose import Pose
from surfsup.scene.restarted_bodies import restarted_body
from surfsup.scene.solids import CONTAINER, SINGLE, Solids, as_named_shape
from surfsup.scene.wrench import Wrench
from surfsup.sph.rigid.body import Body, BodyState, distances_and_normals
from surfsup.sph.rigid.contact import Contacts, Obstacle, at_rest, velocity_between

OVERLAP = 0.02  # of the size of a body, by which its surface may be inside something at the start

States = Mapping[str, BodyState]


class RigidBodies:
    """The rigid bodies of a scene, in its units.

    Args:
        scene: gives walls, gravity and density of the fluid.
        solids: of the scene at its start.

    Raises:
        InputError: a body has no volume, or overlaps walls or another solid at the start.
    """

    def __init__(self, scene: Scene, solids: Solids) -> None:
        self._scene, self.gravity = scene, np.array(scene.gravity, np.float64)
        self.bodies = [Body(solid, scene.density) for solid in solids.moving if solid.body is not None]
        container = scene.container
        self.lower, self.upper = np.array(container.lower), np.array(container.upper)
        self._check_start(solids)

    def start(self) -> dict[str, BodyState]:
        """The states by name at the start of the scene, or at the end of the trajectory that it continues."""
        return {body.name: self._start(body) for body in self.bodies}

    def _start(self, body: Body) -> BodyState:
        restarted = restarted_body(self._scene, body.name)
        return body.start() if restarted is None else BodyState.of(*restarted)

    def advanced(
        self, states: States, solids: Solids, start: Mapping[str, Pose], end: Mapping[str, Pose], time: float
    ) -> dict[str, BodyState]:
        """The states after a frame, by the forces of the frame before, gravity and contacts.

        Args:
            states: of those bodies that move freely.
            solids: all solids, for contacts.
            start: poses of all that moves, before the frame.
            end: those of what does not move freely, after it.
            time: of the frame, seconds.
        """
        bodies = [body for body in self.bodies if body.name in states]
        falling = [body.accelerated(states[body.name], self.gravity, time) for body in bodies]
        contacts = Contacts(bodies, falling, self._obstacles(bodies, solids, start, end, time), time)
        contacts.solve()
        moved = {}
        for number, (body, state) in enumerate(zip(bodies, falling, strict=True)):
            stopped = replace(state, velocity=contacts.velocity[number], angular_velocity=contacts.spin[number])
            moved[body.name] = body.moved(stopped, time)
        return moved

    def pushed(self, states: States, wrenches: Mapping[str, Wrench]) -> dict[str, BodyState]:
        """The states with the accelerations that follow from the forces of the fluid in the frame that ends there."""
        return {
            body.name: body.pushed(states[body.name], wrenches[body.name])
            for body in self.bodies
            if body.name in states
        }

    def _obstacles(
        self,
        bodies: Sequence[Body],
        solids: Solids,
        start: Mapping[str, Pose],
        end: Mapping[str, Pose],
        time: float,
    ) -> list[Obstacle]:
        free = {body.name: number for number, body in enumerate(bodies)}
        found = []
        if CONTAINER in end:
            pose = start[CONTAINER]
            velocity = velocity_between(pose, end[CONTAINER], time)
            found.append(Obstacle(lambda points: self._walls(points, pose), velocity))
        else:
            found.append(Obstacle(lambda points: self._walls(points, Pose.of()), at_rest))
        passed = {name for body in bodies for name in body.passes}
        parts = {part.name: part.surface for part in solids.parts}
        if solids.still is not None and not passed & set(parts):
            parts = {SINGLE: solids.still}
        for name, surface in parts.items():
            found.append(Obstacle(partial(distances_and_normals, surface, Pose.of()), at_rest, name=name))
        for solid in solids.moving:
            here = start[solid.name]
            query = partial(distances_and_normals, solid.surface, here)
            if solid.name in free:
                found.append(Obstacle(query, None, free[solid.name], solid.name))
            else:
                found.append(Obstacle(query, velocity_between(here, end[solid.name], time), name=solid.name))
        return found

    def _walls(self, points: np.ndarray, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
        """Distance (N,) and normal (N, 3) of the nearest wall of a container at a pose."""
        own = pose.to_own(points)
        room = np.concatenate([own - self.lower, self.upper - own], axis=1)
        side = room.argmin(axis=1)
        normals = np.concatenate([np.eye(3), -np.eye(3)])[side]
        return room[np.arange(len(side)), side], normals @ pose.matrix.T

    def _check_start(self, solids: Solids) -> None:
        """Refuse bodies that begin inside walls or solids; one on an axle passes through them for good."""
        # Of a scene that continues another, the start of that one.
        rest = {body.name: as_named_shape(self._scene.surfaces[body.name]) for body in self.bodies}
        poses = {**solids.poses(0.0), **{name: shape.rest for name, shape in rest.items() if shape is not None}}
        for body in self.bodies:
            points = poses[body.name].apply(body.points)
            allowed = -OVERLAP * body.radius
            depth = self._walls(points, poses.get(CONTAINER, Pose.of()))[0].min()
            if depth < allowed and body.axle is not None:
                body.passes.add(CONTAINER)
            elif depth < allowed:
                raise InputError(
                    f"surface '{body.name}' is a rigid body that begins {-depth:.3g} m outside the container; "
                    "move it inside"
                )
            others = [(part.name, part.surface, Pose.of()) for part in solids.parts]
            others += [(s.name, s.surface, poses[s.name]) for s in solids.moving if s.name != body.name]
            for name, surface, pose in others:
                depth = distances_and_normals(surface, pose, points)[0].min()
                if depth < allowed and body.axle is not None:
                    body.passes.add(name)
                elif depth < allowed:
                    raise InputError(
                        f"surface '{body.name}' is a rigid body that begins {-depth:.3g} m inside '{name}'; move it out"
                    )
