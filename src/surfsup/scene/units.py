"""Froude similarity: how a scene with particles of any size relates to one in the units of the simulators.

The solver, the networks, the reference and the boundary volume maps know particles of one radius, 15 mm, and frames of
5 ms. Two scenes whose lengths have the ratio s flow alike under the same gravity if times and velocities have the ratio
√s and kinematic viscosities s^1.5: the Froude number v² / (g l) and the Reynolds number v l / ν are then equal
(G. K. Batchelor, "An Introduction to Fluid Dynamics", 1967, section 4.7). So a scene with particles of radius r is
simulated at the size at which they have 15 mm, with s = r / 15 mm, and its frames are scaled back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from surfsup.scene.fluid import PARTICLE_RADIUS, InitialParticles
from surfsup.scene.liquid import Liquid
from surfsup.scene.motion import PoseFunction
from surfsup.scene.nozzle import Nozzle
from surfsup.scene.pose import Pose
from surfsup.scene.solids import Solids
from surfsup.scene.strict_model import Vector
from surfsup.sdf import Surface, Transformed
from surfsup.sdf.placement import moved

if TYPE_CHECKING:
    from surfsup.scene.scene import Scene

FRAME_TIME = 0.005  # seconds between the simulators' frames, in their own units
FAR = 100.0  # meters from the origin of the scene, within which its coordinates are used as they are


@dataclass(frozen=True)
class Units:
    """Factors that take values of the simulators to values of a scene.

    Attributes:
        radius: particle radius of the scene in meters.
        origin: point of the scene that is the origin of the simulators, meters.

    Examples:
        >>> units = Units(0.06)  # particles four times as large
        >>> units.length, units.velocity, units.viscosity
        (4.0, 2.0, 8.0)
        >>> round(units.frame_time, 6)
        0.01
    """

    radius: float
    origin: Vector = (0.0, 0.0, 0.0)

    def around(self, scene: Scene, start: InitialParticles) -> Units:
        """The same with an origin amid particles that are far from that of a scene without walls.

        Single precision would lose their motion: at 1 km its numbers are 0.06 mm apart, as far as a particle of 6 cm/s
        moves in a substep.
        """
        positions = start.positions
        with_walls = not scene.container.open or scene.is_open  # taps are where the scene says
        if with_walls or len(positions) == 0 or np.abs(positions).max() <= FAR:
            return self
        x, y, z = np.round(positions.astype(np.float64).mean(axis=0)).tolist()
        return replace(self, origin=(x, y, z))

    @property
    def length(self) -> float:
        """Of lengths."""
        return self.radius / PARTICLE_RADIUS

    @property
    def time(self) -> float:
        """Of times."""
        return math.sqrt(self.length)

    @property
    def velocity(self) -> float:
        """Of velocities."""
        return math.sqrt(self.length)

    @property
    def viscosity(self) -> float:
        """Of kinematic viscosities."""
        return self.length**1.5

    @property
    def tension(self) -> float:
        """Of surface tensions at equal density."""
        return self.length**2

    @property
    def force(self) -> float:
        """Of forces at equal density; torques have ``force * length``."""
        return self.length**3

    @property
    def frame_time(self) -> float:
        """Seconds of the scene in a frame of the simulators."""
        return FRAME_TIME * self.time

    @property
    def same(self) -> bool:
        """Whether nothing changes."""
        return self.length == 1.0 and not any(self.origin)

    def scene_to_solver(self, scene: Scene) -> Scene:
        """``scene`` at the size at which its particles have the solver's radius, without its fluid and solids.

        They are placed in the scene's own units; :meth:`particles_to_solver` and :meth:`solids_to_solver` convert them.
        """
        if self.same:
            return scene
        s = self.length
        size = scene.container.size
        sides = (size[0] / s, size[1] / s, size[2] / s)
        changes: dict[str, object] = {
            "container": scene.container.model_copy(update={"size": sides, "motion": None}),
            "surface": None,
            "surfaces": {},
            "fluid": [],
            "taps": [],
            "drains": [],
            "particle_radius": PARTICLE_RADIUS,
            "liquid": self.liquid_to_solver(scene.liquid),
        }
        copy = scene.model_copy(update={**changes, "fps": scene.fps and scene.fps * self.time, "duration": None})
        copy = copy.with_base_folder(scene.base_folder)
        liquids = [self.liquid_to_solver(liquid) for liquid in scene.mixture]
        return copy.with_mixture(tuple(liquid for liquid in liquids if liquid is not None)) if liquids else copy

    def liquid_to_solver(self, liquid: Liquid | None) -> Liquid | None:
        """A liquid in the units of the solver, with the same density."""
        if liquid is None or self.same:
            return liquid
        changes = {
            "viscosity": None if liquid.viscosity is None else liquid.viscosity / self.viscosity,
            "surface_tension": liquid.surface_tension / self.tension,
            "adhesion": liquid.adhesion / self.tension,
        }
        return liquid.model_copy(update=changes)

    def surface_to_solver(self, surface: Surface | None) -> Surface | None:
        """A solid in the units of the scene as one in those of the solver."""
        return surface if surface is None or self.same else self.placed_to_solver(surface)

    def placed_to_solver(self, surface: Surface) -> Surface:
        """:meth:`surface_to_solver` where units differ."""
        if any(self.origin):
            surface = moved(surface, -np.asarray(self.origin))
        return Transformed(surface, scale=1 / self.length)

    def solids_to_solver(self, solids: Solids, start_time: float = 0.0) -> Solids:
        """The solids of a scene in the units of the solver, whose time 0 is ``start_time`` seconds of the scene."""
        if self.same and start_time == 0:
            return solids
        moving = tuple(
            replace(
                solid,
                surface=solid.surface if self.same else Transformed(solid.surface, scale=1 / self.length),
                pose=self.motion_to_solver(solid.pose, start_time),
            )
            for solid in solids.moving
        )
        container = None if solids.container is None else self.motion_to_solver(solids.container, start_time)
        parts = tuple(
            part
            if self.same
            else replace(
                part,
                surface=self.placed_to_solver(part.surface),
                origin=(part.origin - self.origin) / self.length,
            )
            for part in solids.parts
        )
        return Solids(self.surface_to_solver(solids.still), moving, container, parts)

    def motion_to_solver(self, motion: PoseFunction, start_time: float) -> PoseFunction:
        """The pose over the time of the solver, which is 0 at ``start_time`` seconds of the scene."""
        return lambda time: self.pose_to_solver(motion(start_time + self.time * time))

    def pose_to_solver(self, pose: Pose) -> Pose:
        """A pose of a scene in the units of the solver."""
        return pose if self.same else Pose((pose.position - self.origin) / self.length, pose.rotation)

    def time_to_solver(self, time: float, start_time: float) -> float:
        """A time of the scene in that of the solver, which is 0 at ``start_time`` seconds of the scene."""
        return (time - start_time) / self.time

    def nozzle_to_solver(self, nozzle: Nozzle, start_time: float) -> Nozzle:
        """A tap of a scene in the units of the solver, whose time 0 is ``start_time`` seconds of the scene."""
        return replace(
            nozzle,
            center=(nozzle.center if nozzle.carrier else nozzle.center - self.origin) / self.length,
            sides=nozzle.sides / self.length,
            half=nozzle.half / self.length,
            speed=nozzle.speed / self.velocity,
            interval=nozzle.interval / self.time,
            start=self.time_to_solver(nozzle.start, start_time),
            until=self.time_to_solver(nozzle.until, start_time),
            guide=nozzle.guide / self.time,
        )

    def particles_to_solver(self, start: InitialParticles) -> InitialParticles:
        """The particles of a scene in the units of the solver."""
        if self.same:
            return start
        return scaled(start, 1 / self.length, 1 / self.velocity, -np.asarray(self.origin))

    def particles_from_solver(self, start: InitialParticles) -> InitialParticles:
        """Particles in the units of the solver as those of a scene; the inverse of :meth:`particles_to_solver`."""
        if self.same:
            return start
        return scaled(start, self.length, self.velocity, np.asarray(self.origin) / self.length)

    def frame_to_solver(self, positions: np.ndarray, velocities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (N, 3) of a frame of the scene in the units of the solver."""
        if self.same:
            return positions, velocities
        if any(self.origin):
            positions = (positions - np.asarray(self.origin)).astype(np.float32)
        return positions / np.float32(self.length), velocities / np.float32(self.velocity)

    def frame_from_solver(self, positions: np.ndarray, velocities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (N, 3) of a frame of the solver in the units of the scene."""
        if self.same:
            return positions, velocities
        positions = np.float32(self.length) * positions
        if any(self.origin):
            positions = (positions + np.asarray(self.origin)).astype(np.float32)
        return positions, np.float32(self.velocity) * velocities


def scaled(start: InitialParticles, length: float, velocity: float, offset: np.ndarray) -> InitialParticles:
    """Particles moved by ``offset`` (3,), then with lengths times ``length`` and velocities times ``velocity``."""

    def times(values: np.ndarray, factor: float) -> np.ndarray:
        return (np.asarray(values, np.float64) * factor).astype(np.float32)

    velocities: list[Vector | np.ndarray] = []
    for given in start.block_velocities:
        if isinstance(given, np.ndarray):
            velocities.append(times(given, velocity))
        else:
            x, y, z = given
            velocities.append((velocity * x, velocity * y, velocity * z))
    positions = [times(np.asarray(block, np.float64) + offset, length) for block in start.block_positions]
    return replace(start, block_positions=positions, block_velocities=velocities)
