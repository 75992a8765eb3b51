"""The solids of a scene: those that stand still as one surface, and those that may move, each in its own frame."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from pydantic import model_validator

from surfsup.errors import InputError
from surfsup.scene.mesh_surface import MeshFileSurface
from surfsup.scene.motion import Motion, PoseFunction
from surfsup.scene.pose import Pose
from surfsup.scene.quaternion import about_axis
from surfsup.scene.restarted_bodies import restarted_body
from surfsup.scene.rigid_body import RigidBody
from surfsup.scene.shapes import Shape
from surfsup.sdf import Surface, Transformed, Union

if TYPE_CHECKING:
    from surfsup.scene.scene import Scene

CONTAINER = "container"  # the name under which the container moves, and of forces on its walls
SINGLE = "surface"  # the name of the surface of a scene without names
MAX_OWN_DISTANCE = 1000.0  # meters of a point of a moving solid from its own origin, where floats are 0.06 mm apart


class NamedShape(Shape):
    """A surface under ``surfaces``: a shape that may move. ``at`` and ``rotate`` are its pose at rest.

    Attributes:
        motion: along given poses.
        rigid_body: as gravity, water and contacts move it.
        flush: whether the water touches it, so that it displaces its own volume; by default rigid bodies are flush.
    """

    motion: Motion | None = None
    rigid_body: RigidBody | None = None
    flush: bool | None = None

    @model_validator(mode="after")
    def check_one_motion(self) -> NamedShape:
        """Refuse two motions."""
        if self.motion is not None and self.rigid_body is not None:
            raise ValueError("give either motion or rigid_body, not both")
        return self

    @property
    def moves(self) -> bool:
        """Whether it may move."""
        return self.motion is not None or self.rigid_body is not None

    @property
    def rest(self) -> Pose:
        """Where the shape stands without a motion."""
        turn = self.rotate
        rotation = about_axis(turn.axis, torch.pi * turn.degrees / 180) if turn else (1.0, 0.0, 0.0, 0.0)
        return Pose.of(self.at, rotation)

    def own_surface(self, folder: Path) -> Surface:
        """The surface in its own frame: scaled, neither rotated nor moved.

        Raises:
            InputError: a file is missing or unusable, or the surface lies far from its own origin.
        """
        surface = self.model_copy(update={"rotate": None, "at": (0.0, 0.0, 0.0)}).surface(folder)
        distance = float(surface.bounds().abs().max())
        if distance > MAX_OWN_DISTANCE:
            raise InputError(
                f"surfaces: one that moves lies up to {distance:.4g} m from the origin of its own file, about which it "
                "turns; give a mesh 'fit', which centers it"
            )
        return surface

    def map_files(self, function: Callable[[Path], Path]) -> NamedShape:
        """A copy with ``function`` applied to the path of every file, that of its motion too."""
        changed = super().map_files(function)
        motion = None if self.motion is None else self.motion.map_files(function)
        return changed.model_copy(update={"motion": motion})


@dataclass(frozen=True)
class MovingSolid:
    """A solid that may move.

    Attributes:
        name: its key under ``surfaces``.
        surface: in its own frame.
        pose: its pose at a time in seconds; of a rigid body that at the start.
        body: what the scene says of a rigid body, None for other solids.
        flush: whether the water touches it.
    """

    name: str
    surface: Surface
    pose: PoseFunction
    body: RigidBody | None = None
    flush: bool = False

    def at(self, pose: Pose) -> Surface:
        """The surface in the world."""
        return Transformed(self.surface, torch.from_numpy(pose.matrix).float(), torch.from_numpy(pose.position).float())


@dataclass(frozen=True)
class StillSolid:
    """A solid that stands still.

    Attributes:
        name: its key under ``surfaces``, or ``surface``.
        surface: in the world.
        origin: (3,) meters, where ``at`` puts it; that of the world for an object that no file describes.
        flush: whether the water touches it.
    """

    name: str
    surface: Surface
    origin: np.ndarray
    flush: bool = False


@dataclass(frozen=True)
class Solids:
    """The solids of a scene.

    Attributes:
        still: the union of all that stands still, or None.
        moving: those that move.
        container: the pose of a container that moves, or None.
        parts: of ``still``.
    """

    still: Surface | None
    moving: tuple[MovingSolid, ...] = ()
    container: PoseFunction | None = None
    parts: tuple[StillSolid, ...] = ()

    @property
    def move(self) -> bool:
        """Whether anything moves."""
        return bool(self.moving) or self.container is not None

    def require_described(self) -> None:
        """Require that the scene describes all motions.

        Raises:
            InputError: there is a rigid body, whose motion a simulation computes.
        """
        if free := [solid.name for solid in self.moving if solid.body is not None]:
            raise InputError(
                f"surface '{free[0]}' is a rigid body, which moves in 'surfsup simulate' and sf.Simulation only; "
                "omit 'rigid_body', or give a motion"
            )

    def poses(self, time: float) -> dict[str, Pose]:
        """The pose by name of all that moves, at a time in seconds."""
        poses = {solid.name: solid.pose(time) for solid in self.moving}
        return poses if self.container is None else {**poses, CONTAINER: self.container(time)}

    def at(self, poses: Mapping[str, Pose]) -> Surface | None:
        """All solids as one surface in the world."""
        placed = [solid.at(poses[solid.name]) for solid in self.moving]
        parts = placed if self.still is None else [self.still, *placed]
        return None if not parts else parts[0] if len(parts) == 1 else Union(*parts)

    def at_time(self, time: float) -> Surface | None:
        """All solids as one surface in the world, at a time in seconds."""
        return self.at(self.poses(time))


def build_solids(scene: Scene, movable: Collection[str] = ()) -> Solids:
    """The solids of a scene.

    Args:
        scene: the scene.
        movable: names of surfaces, and perhaps the container, that stand still in the scene but may be moved.

    Raises:
        InputError: a file of a surface or a motion is missing or unusable, or there is no such surface.
    """
    if unknown := [name for name in movable if name not in scene.surfaces and name != CONTAINER]:
        known = f"known are {', '.join(scene.surfaces)}" if scene.surfaces else "name them under 'surfaces'"
        raise InputError(f"there is no surface '{unknown[0]}' to move; {known}")
    parts, moving = [], []
    if (single := scene.build_single_surface()) is not None:
        parts.append(StillSolid(SINGLE, single, origin_of(scene.surface)))
    for name, entry in scene.surfaces.items():
        motion = entry.motion if isinstance(entry, NamedShape) else None
        body = entry.rigid_body if isinstance(entry, NamedShape) else None
        flush = isinstance(entry, NamedShape) and (body is not None if entry.flush is None else entry.flush)
        if motion is None and body is None and name not in movable:
            surface = entry.surface(scene.base_folder) if isinstance(entry, Shape) else entry
            parts.append(StillSolid(name, surface, origin_of(entry), flush))
            continue
        shape = as_named_shape(entry)
        if shape is None:
            assert isinstance(entry, Surface)
            rest, surface = Pose.of(), entry
        else:
            rest, surface = shape.rest, shape.own_surface(scene.base_folder)
        if body is not None and (restarted := restarted_body(scene, name)) is not None:
            rest, _ = restarted
        pose = constant(rest) if motion is None else motion.pose_function(rest, scene.base_folder)
        moving.append(MovingSolid(name, surface, pose, body, flush))
    container, shaken = None, scene.container.motion
    if shaken is not None or CONTAINER in movable:
        container = constant(Pose.of()) if shaken is None else shaken.pose_function(Pose.of(), scene.base_folder)
    return Solids(union_of(parts), tuple(moving), container, tuple(parts))


def union_of(parts: Sequence[StillSolid]) -> Surface | None:
    """All ``parts`` as one surface, None without any."""
    surfaces = [part.surface for part in parts]
    return None if not surfaces else surfaces[0] if len(surfaces) == 1 else Union(*surfaces)


def origin_of(entry: Shape | Surface | None) -> np.ndarray:
    """The origin (3,) of a surface in the world, meters."""
    shape = entry.shape if isinstance(entry, MeshFileSurface) else entry
    return np.array(shape.at if isinstance(shape, Shape) else (0.0, 0.0, 0.0))


def as_named_shape(entry: Shape | Surface) -> NamedShape | None:
    """The description of a surface; None for an object that no file describes."""
    if isinstance(entry, MeshFileSurface):
        entry = entry.shape
    if isinstance(entry, NamedShape) or not isinstance(entry, Shape):
        return entry if isinstance(entry, NamedShape) else None
    return NamedShape(**dict(entry))


def constant(pose: Pose) -> PoseFunction:
    """The motion of what stands still."""
    return lambda time: pose
