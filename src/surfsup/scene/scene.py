"""A scene: container, surface, fluid, gravity and frames, as a YAML file or built in Python."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import yaml
from pydantic import Field, GetPydanticSchema, PrivateAttr, ValidationError
from pydantic_core import core_schema
from scipy.spatial import cKDTree

from surfsup.errors import InputError
from surfsup.scene.fluid import SPACING, Block, Fluid, InitialParticles
from surfsup.scene.mesh_surface import MeshFileSurface
from surfsup.scene.safe_yaml import parse_yaml
from surfsup.scene.shapes import Shape
from surfsup.scene.strict_model import Length, StrictModel, Velocity, for_callers_only
from surfsup.scene.validation_error import format_validation_error
from surfsup.sdf import Surface
from surfsup.sdf.neural.shipped_surfaces import is_shipped

FRAME_TIME = 0.005  # seconds
# Minimum distance of particles at the start, in meters: in the reference solver at most 0.04 % come closer (measured).
SURFACE_CLEARANCE = 0.0238
WALL_CLEARANCE = 0.024
WALL_CELL = 0.05  # meters, approximately: cell size of the walls' boundary volume maps


class Container(StrictModel):
    """The box around everything: x and y centered on 0, floor at z = 0, sides ``size`` in meters.

    Examples:
        >>> Container(size=(2, 1, 1)).lower
        (-1.0, -0.5, 0.0)
    """

    size: tuple[Length, Length, Length] = (1.0, 1.0, 2.0)

    @property
    def lower(self) -> tuple[float, float, float]:
        """The corner with the smallest coordinates, meters."""
        return (-self.size[0] / 2, -self.size[1] / 2, 0.0)

    @property
    def upper(self) -> tuple[float, float, float]:
        """The corner with the largest coordinates, meters."""
        return (self.size[0] / 2, self.size[1] / 2, self.size[2])


STANDARD_CONTAINER = Container()


def accept_surface(value: object, validate: core_schema.ValidatorFunctionWrapHandler) -> object:
    """Take a Surface object as it is; validate anything else as a shape description."""
    return value if isinstance(value, Surface) else validate(value)


# A file describes a shape; only Python code gives a Surface. So messages about files speak of shapes alone.
SurfaceSchema = GetPydanticSchema(
    lambda _, handler: core_schema.no_info_wrap_validator_function(accept_surface, handler(Shape | None))
)


class Scene(StrictModel):
    """What to simulate; ``docs/scene-file.md`` describes the file.

    Attributes:
        fluid: blocks of fluid.
        surface: the solid, as a shape description or a Surface; None for an empty container.
        container: the box around everything.
        gravity: m/s².
        frames: number of frames, FRAME_TIME seconds each.

    Raises:
        InputError: a value is out of range.

    Examples:
        >>> import surfsup as sf
        >>> scene = sf.Scene(surface=sf.Sphere(0.2), fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=100)
        >>> scene.gravity
        (0.0, 0.0, -9.81)
    """

    container: Container = STANDARD_CONTAINER
    surface: Annotated[Shape | Surface | None, SurfaceSchema] = None
    fluid: list[Fluid] = Field(min_length=1)
    gravity: Velocity = (0.0, 0.0, -9.81)
    frames: int = Field(default=800, ge=1)
    _folder: Path = PrivateAttr(default=Path())

    @for_callers_only
    def __init__(
        self,
        *,
        fluid: Sequence[Block | Fluid],
        surface: Shape | Surface | None = None,
        container: Container = STANDARD_CONTAINER,
        gravity: Velocity = (0.0, 0.0, -9.81),
        frames: int = 800,
    ) -> None:
        entries = [Fluid(block=entry) if isinstance(entry, Block) else entry for entry in fluid]
        super().__init__(fluid=entries, surface=surface, container=container, gravity=gravity, frames=frames)

    @classmethod
    def from_yaml(cls, text: str, source: str, folder: Path = Path()) -> Scene:
        """Read a scene from YAML text.

        Args:
            text: YAML.
            source: name of the text in an error message, usually the file's.
            folder: base of relative paths in the text.

        Raises:
            InputError: the text is not YAML, a key is unknown, or a value is out of range; names the place.
        """
        data = parse_yaml(text, source)
        if not isinstance(data, dict):
            raise InputError(f"{source}: a scene is a mapping with at least the key 'fluid'")
        try:
            scene = cls.model_validate(data)
        except ValidationError as error:
            raise InputError(f"{source}: {format_validation_error(error, cls)}") from None
        scene._folder = folder
        return scene

    @classmethod
    def load(cls, path: str | Path) -> Scene:
        """Read a scene from a YAML file. Paths in it are relative to its folder.

        Raises:
            InputError: the file is missing or not a scene.
        """
        path = Path(path)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not text"
            raise InputError(f"{path}: cannot be read as a scene: {reason}") from None
        return cls.from_yaml(text, str(path), path.parent)

    def to_yaml(self) -> str:
        """The scene as YAML, without the values that equal their defaults.

        Raises:
            InputError: the surface is an object that no file describes.
        """
        shape = self.shape
        if isinstance(shape, Surface):
            raise InputError(
                f"scene: a file cannot describe its surface, a {type(shape).__name__} object; "
                "give a Shape, or a surface from load_mesh"
            )
        data = self.model_copy(update={"surface": shape}).model_dump(mode="json", exclude_defaults=True)
        return yaml.safe_dump(data, sort_keys=False, default_flow_style=None)

    @property
    def shape(self) -> Shape | Surface | None:
        """The description of the surface as a file holds it; the surface itself if there is none."""
        return self.surface.shape if isinstance(self.surface, MeshFileSurface) else self.surface

    @property
    def surface_kind(self) -> str:
        """The kind of the surface: a key of a scene file, "none" for no surface, "object" for one without a key."""
        shape = self.shape
        return "none" if shape is None else shape.kind if isinstance(shape, Shape) else "object"

    def with_paths_relative_to(self, folder: Path, root: Path | None = None) -> Scene:
        """A copy for a file in ``folder``: paths inside ``root`` become relative to ``folder``, others absolute.

        So a root folder with scenes and their meshes can be moved as a whole. Names of shipped surfaces stay.

        Args:
            folder: folder of the new file.
            root: folder that may be moved as a whole; ``folder`` by default.
        """
        shape = self.shape
        if not isinstance(shape, Shape):
            return self
        target, inside = folder.resolve(), (root or folder).resolve()

        def relocate(file: Path) -> Path:
            if is_shipped(file):
                return file
            absolute = (self._folder / file).resolve()
            return Path(os.path.relpath(absolute, target)) if absolute.is_relative_to(inside) else absolute

        return self.model_copy(update={"surface": shape.map_files(relocate)}).with_base_folder(folder)

    def with_base_folder(self, folder: Path) -> Scene:
        """A copy whose relative paths start at ``folder``."""
        copy = self.model_copy()
        copy._folder = folder
        return copy

    def with_frames(self, frames: int) -> Scene:
        """A copy with another number of frames."""
        return self.model_copy(update={"frames": frames})

    def build_surface(self) -> Surface | None:
        """The signed distance function of the solid; None for an empty container.

        Raises:
            InputError: a file of the surface is missing or unusable.
        """
        return self.surface.surface(self._folder) if isinstance(self.surface, Shape) else self.surface

    def initial_particles(self, surface: Surface | None) -> InitialParticles:
        """Fill the blocks with particles, except where they overlap the solid or an earlier block.

        Args:
            surface: the surface of :meth:`build_surface`.

        Raises:
            InputError: a block reaches out of the container, or no particle remains.
        """
        blocks, velocities, placed, excluded = [], [], np.empty((0, 3), np.float32), 0
        for number, entry in enumerate(self.fluid):
            self._check_inside_container(number, entry.block)
            positions = entry.block.positions()
            free = np.ones(len(positions), dtype=bool)
            if surface is not None:
                with torch.no_grad():
                    free &= (surface.distance(torch.from_numpy(positions)) >= SURFACE_CLEARANCE).numpy()
            if len(placed):
                free &= cKDTree(placed).query(positions)[0] > 0.9 * SPACING
            excluded += int((~free).sum())
            if free.any():
                blocks.append(positions[free])
                velocities.append(entry.block.velocity)
                placed = np.concatenate([placed, positions[free]])
        if not blocks:
            raise InputError(
                f"fluid: all {excluded} particles are inside the solid; move the block or make the surface smaller"
            )
        return InitialParticles(blocks, velocities, excluded)

    def _check_inside_container(self, number: int, block: Block) -> None:
        limits = zip("xyz", self.container.lower, self.container.upper, strict=True)
        for (name, low, high), (first, last), start, end in zip(
            limits, block.particle_bounds(), block.min, block.max, strict=True
        ):
            if first < low + WALL_CLEARANCE or last > high - WALL_CLEARANCE:
                raise InputError(
                    f"fluid: block {number} reaches from {start:.3g} to {end:.3g} m along "
                    f"{name}, outside the container ({low:.3g} to {high:.3g} m); "
                    "move the block or enlarge the container"
                )
