"""A rigid body: mass, the points at which it touches others, and its motion in a frame.

Rigid-body dynamics as in D. Baraff, "Physically based modeling: rigid body simulation", SIGGRAPH tutorial notes, 2001.
The coupling to the fluid is partitioned: a frame of the fluid with the body's motion, then a frame of the body with the
force of that frame. A body that is lighter than the water it accelerates makes such a scheme unstable (P. Causin,
J.-F. Gerbeau and F. Nobile, "Added-mass effect in the design of partitioned algorithms for fluid-structure problems",
Computer Methods in Applied Mechanics and Engineering 194, 2005). So a virtual mass m of water is added on both sides,
(M + m) a = F + m a', with the acceleration a' of the frame before: the mean of the motion stays the same, and changes
within a few frames are smoothed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch

from surfsup.scene import quaternion
from surfsup.scene.pose import Pose
from surfsup.scene.rigid_body import MassProperties
from surfsup.scene.solids import MovingSolid
from surfsup.scene.wrench import Wrench

CONTACT_POINTS = 240  # on the surface of a body, about


@dataclass(frozen=True)
class BodyState:
    """Where a rigid body is and how it moves. All vectors are those of the world.

    Attributes:
        pose: of its surface.
        velocity: (3,) of the center of mass, m/s.
        angular_velocity: (3,) rad/s.
        acceleration: (3,) of the center of mass by the fluid, m/s².
        angular_acceleration: (3,) by the fluid, rad/s².
    """

    pose: Pose
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray
    angular_acceleration: np.ndarray


class Body:
    """A rigid body in the units of the scene.

    Args:
        solid: its surface and pose at rest.
        fluid_density: kg/m³.

    Attributes:
        name: of the surface.
        mass: its mass properties.
        points: (K, 3) on its surface, in its frame.
        radius: the largest distance of a point from the center of mass, meters.

    Raises:
        InputError: the surface has no volume.
    """

    def __init__(self, solid: MovingSolid, fluid_density: float) -> None:
        assert solid.body is not None
        self.name, self.solid = solid.name, solid
        self.mass = MassProperties.of(solid.body, solid.surface, solid.name)
        self.points = surface_points(solid)
        # The virtual mass is the added mass of a disk as large as the largest side of the box around the body, 8/3 ρ a³
        # (H. Lamb, "Hydrodynamics", 1932): more than that of the body. A larger one only smooths more.
        sides = np.sort(np.ptp(self.points, axis=0))
        self.radius = float(np.linalg.norm(self.points - self.mass.center, axis=1).max())
        radius = math.sqrt(sides[1] * sides[2] / math.pi)
        virtual = 8 / 3 * fluid_density * radius**3
        self.share = self.mass.mass / (self.mass.mass + virtual)
        self.virtual_inertia = 2 / 5 * virtual * radius**2 * np.eye(3)

    def start(self) -> BodyState:
        """The state at the start of the scene."""
        assert self.solid.body is not None
        velocity, spin = (np.array(v) for v in (self.solid.body.velocity, self.solid.body.angular_velocity))
        return BodyState(self.solid.pose(0.0), velocity, spin, np.zeros(3), np.zeros(3))

    def center(self, pose: Pose) -> np.ndarray:
        """The center of mass (3,) in the world."""
        return pose.apply(self.mass.center[None])[0]

    def inertia(self, pose: Pose) -> np.ndarray:
        """The moments of inertia (3, 3) about the center of mass, along the axes of the world."""
        return pose.matrix @ self.mass.inertia @ pose.matrix.T

    def accelerated(self, state: BodyState, gravity: np.ndarray, time: float) -> BodyState:
        """The state with the velocities after ``time`` seconds, still at its pose."""
        inertia, spin = self.inertia(state.pose), state.angular_velocity
        gyroscopic = np.linalg.solve(inertia, -np.cross(spin, inertia @ spin))
        return replace(
            state,
            velocity=state.velocity + time * (gravity + state.acceleration),
            angular_velocity=spin + time * (state.angular_acceleration + gyroscopic),
        )

    def moved(self, state: BodyState, time: float) -> BodyState:
        """The state at the pose after ``time`` seconds with its velocities: semi-implicit Euler."""
        center = self.center(state.pose) + time * state.velocity
        turn = quaternion.exponential(time * state.angular_velocity)
        rotation = quaternion.normalized(quaternion.product(turn, state.pose.rotation))
        position = center - quaternion.matrix(rotation) @ self.mass.center
        return replace(state, pose=Pose(position, rotation))

    def pushed(self, state: BodyState, wrench: Wrench) -> BodyState:
        """The state whose accelerations by the fluid follow from the ``wrench`` of the frame that ends there."""
        force, torque = wrench
        torque = torque - np.cross(state.pose.matrix @ self.mass.center, force)
        inertia = self.inertia(state.pose)
        acceleration = self.share * force / self.mass.mass + (1 - self.share) * state.acceleration
        turning = np.linalg.solve(
            inertia + self.virtual_inertia, torque + self.virtual_inertia @ state.angular_acceleration
        )
        return replace(state, acceleration=acceleration, angular_acceleration=turning)


def surface_points(solid: MovingSolid) -> np.ndarray:
    """Points (K, 3) spread over the surface of a solid, in its frame: vertices of its triangles, corners included."""
    vertices = np.asarray(solid.surface.to_mesh(32).vertices, np.float64)
    if len(vertices) <= CONTACT_POINTS:
        return vertices
    # Of each cell of a lattice, the vertex furthest from the middle.
    lower, size = vertices.min(axis=0), np.ptp(vertices, axis=0)
    cell = float(size.max()) / math.sqrt(CONTACT_POINTS / 6)
    cells = np.floor((vertices - lower) / cell).astype(np.int64)
    key = cells @ np.array([1, 1000, 1000000])
    distance = np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)
    order = np.lexsort((distance, key))
    last = np.append(key[order][1:] != key[order][:-1], True)
    return vertices[order[last]]


def distances_and_normals(surface: object, pose: Pose, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance (N,) and normal (N, 3) in the world of a solid at a pose, at ``points`` (N, 3)."""
    own = torch.from_numpy(pose.to_own(points).astype(np.float32))
    with torch.no_grad():
        distance, normal = surface.distance_and_normal(own)  # type: ignore[attr-defined]
    return distance.double().numpy(), normal.double().numpy() @ pose.matrix.T
