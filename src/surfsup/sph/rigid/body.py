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
from surfsup.scene.rigid_body import Axle, MassProperties
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

    @property
    def motion(self) -> np.ndarray:
        """All but the pose, in this order, in one array (12,)."""
        return np.concatenate([self.velocity, self.angular_velocity, self.acceleration, self.angular_acceleration])

    @classmethod
    def of(cls, pose: Pose, motion: np.ndarray) -> BodyState:
        """The state with a pose and all others in one array (12,)."""
        velocity, spin, acceleration, turning = np.split(np.asarray(motion, np.float64), 4)
        return cls(pose, velocity, spin, acceleration, turning)


@dataclass(frozen=True)
class AxleMotion:
    """A fixed axis that a body turns about.

    Attributes:
        axis: (3,) unit vector.
        point: (3,) on it, meters.
        damping: of the turn, N m s.
    """

    axis: np.ndarray
    point: np.ndarray
    damping: float

    @classmethod
    def of(cls, axle: Axle, center: np.ndarray) -> AxleMotion:
        """That of a scene file, for a body with its ``center`` (3,) of mass there at the start."""
        axis = np.array(axle.axis) / np.linalg.norm(axle.axis)
        return cls(axis, center if axle.point is None else np.array(axle.point), axle.damping)

    def along(self, vector: np.ndarray) -> np.ndarray:
        """The part (3,) of a vector along the axis."""
        return (self.axis @ vector) * self.axis

    def velocity(self, spin: np.ndarray, place: np.ndarray) -> np.ndarray:
        """The velocity (3,) of a ``place`` (3,) of a body that turns at ``spin`` (3,)."""
        return np.cross(spin, place - self.point)


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
        axle: the axis that it turns about, or None.
        passes: names of what it turns through, such as a post on its axle.

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
        self.passes: set[str] = set()
        self.axle = None if solid.body.axle is None else AxleMotion.of(solid.body.axle, self.center(solid.pose(0.0)))

    def start(self) -> BodyState:
        """The state at the start of the scene."""
        assert self.solid.body is not None
        velocity, spin = (np.array(v) for v in (self.solid.body.velocity, self.solid.body.angular_velocity))
        if self.axle is not None:
            spin = self.axle.along(spin)
            velocity = self.axle.velocity(spin, self.center(self.solid.pose(0.0)))
        return BodyState(self.solid.pose(0.0), velocity, spin, np.zeros(3), np.zeros(3))

    def center(self, pose: Pose) -> np.ndarray:
        """The center of mass (3,) in the world."""
        return pose.apply(self.mass.center[None])[0]

    def inertia(self, pose: Pose) -> np.ndarray:
        """The moments of inertia (3, 3) about the center of mass, along the axes of the world."""
        return pose.matrix @ self.mass.inertia @ pose.matrix.T

    def _inertia_about_axle(self, pose: Pose) -> float:
        """The moment of inertia about the axle, kg m²."""
        assert self.axle is not None
        arm = np.cross(self.axle.axis, self.center(pose) - self.axle.point)
        return float(self.axle.axis @ self.inertia(pose) @ self.axle.axis + self.mass.mass * (arm @ arm))

    def inverse_mass(self, pose: Pose) -> np.ndarray:
        """What an impulse and its moment about the center of mass (6,) change in velocity and spin, (6, 6).

        On an axle they change the turn alone, and with it the velocity of the center.
        """
        if self.axle is not None:
            turn = np.concatenate([self.axle.velocity(self.axle.axis, self.center(pose)), self.axle.axis])
            return np.outer(turn, turn) / self._inertia_about_axle(pose)
        inverse = np.zeros((6, 6))
        inverse[:3, :3], inverse[3:, 3:] = np.eye(3) / self.mass.mass, np.linalg.inv(self.inertia(pose))
        return inverse

    def accelerated(self, state: BodyState, gravity: np.ndarray, time: float) -> BodyState:
        """The state with the velocities after ``time`` seconds, still at its pose."""
        inertia, spin = self.inertia(state.pose), state.angular_velocity
        if self.axle is not None:
            torque = np.cross(self.center(state.pose) - self.axle.point, self.mass.mass * gravity)
            turning = self.axle.along(torque - self.axle.damping * spin) / self._inertia_about_axle(state.pose)
            spin = spin + time * (state.angular_acceleration + turning)
            velocity = self.axle.velocity(spin, self.center(state.pose))
            return replace(state, velocity=velocity, angular_velocity=spin)
        gyroscopic = np.linalg.solve(inertia, -np.cross(spin, inertia @ spin))
        return replace(
            state,
            velocity=state.velocity + time * (gravity + state.acceleration),
            angular_velocity=spin + time * (state.angular_acceleration + gyroscopic),
        )

    def moved(self, state: BodyState, time: float) -> BodyState:
        """The state at the pose after ``time`` seconds with its velocities: semi-implicit Euler."""
        turn = quaternion.exponential(time * state.angular_velocity)
        rotation = quaternion.normalized(quaternion.product(turn, state.pose.rotation))
        if self.axle is not None:
            arm = quaternion.matrix(turn) @ (state.pose.position - self.axle.point)
            return replace(state, pose=Pose(self.axle.point + arm, rotation))
        center = self.center(state.pose) + time * state.velocity
        position = center - quaternion.matrix(rotation) @ self.mass.center
        return replace(state, pose=Pose(position, rotation))

    def pushed(self, state: BodyState, wrench: Wrench) -> BodyState:
        """The state whose accelerations by the fluid follow from the ``wrench`` of the frame that ends there."""
        force, torque = wrench
        if self.axle is not None:
            about = self.axle.along(torque + np.cross(state.pose.position - self.axle.point, force))
            virtual = float(self.virtual_inertia[0, 0])
            turning = (about + virtual * state.angular_acceleration) / (self._inertia_about_axle(state.pose) + virtual)
            return replace(state, angular_acceleration=turning)
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
