"""A scene: container, surface, fluid, gravity; a validated YAML file in, the same file out."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import torch
import yaml
from pydantic import Field, PrivateAttr, ValidationError
from scipy.spatial import cKDTree

from surfsup.errors import InputError
from surfsup.scene.fluid import SPACING, Block, Fluid, Start
from surfsup.scene.shapes import Description, Length, Shape, Vector
from surfsup.scene.validation_message import one_line
from surfsup.scene.yaml_text import parse_yaml
from surfsup.sdf import Surface
from surfsup.sdf.neural.shipped_surfaces import is_shipped

FRAME_TIME = 0.005  # seconds
# Meters that water keeps at its start: in a simulation at most 0.04 % of the solver's particles are nearer (measured).
SURFACE_CLEARANCE = 0.0238
WALL_CLEARANCE = 0.024
WALL_CELL = 0.05  # meters, about: the side of the cells that the solver looks the walls up in


class Container(Description):
    """The box that holds everything: x and y centered on 0, floor at z = 0, sides ``size`` in meters."""

    size: tuple[Length, Length, Length] = (1.0, 1.0, 2.0)

    @property
    def lower(self) -> tuple[float, float, float]:
        """The corner with the smallest coordinates, meters."""
        return (-self.size[0] / 2, -self.size[1] / 2, 0.0)

    @property
    def upper(self) -> tuple[float, float, float]:
        """The corner with the largest coordinates, meters."""
        return (self.size[0] / 2, self.size[1] / 2, self.size[2])


class Scene(Description):
    """What is simulated; see ``docs/scene-file.md`` for the file's form."""

    container: Container = Container()
    surface: Shape | None = None
    fluid: list[Fluid] = Field(min_length=1)
    gravity: Vector = (0.0, 0.0, -9.81)
    frames: int = Field(default=800, ge=1)
    _folder: Path = PrivateAttr(default=Path())

    @classmethod
    def from_yaml(cls, text: str, source: str, folder: Path = Path()) -> Scene:
        """The scene that ``text`` describes.

        Args:
            text: YAML.
            source: what to call the text in a complaint, usually the file's name.
            folder: where relative mesh files start.

        Raises:
            InputError: not YAML, an unknown key, or a value out of range; says which.
        """
        data = parse_yaml(text, source)
        if not isinstance(data, dict):
            raise InputError(f"{source}: a scene is a mapping with at least the key 'fluid'")
        try:
            scene = cls.model_validate(data)
        except ValidationError as error:
            raise InputError(f"{source}: {one_line(error, cls)}") from None
        scene._folder = folder
        return scene

    @classmethod
    def load(cls, path: Path) -> Scene:
        """The scene in the YAML file ``path``; its mesh files are found relative to it.

        Raises:
            InputError: the file is missing or not a scene.
        """
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it is not text"
            raise InputError(f"{path}: cannot be read as a scene: {reason}") from None
        return cls.from_yaml(text, str(path), path.parent)

    def to_yaml(self) -> str:
        """The scene as YAML; values that are left at their defaults are left out."""
        data = self.model_dump(mode="json", exclude_defaults=True)
        return yaml.safe_dump(data, sort_keys=False, default_flow_style=None)

    def with_files_from(self, folder: Path, within: Path | None = None) -> Scene:
        """The same scene for a file in ``folder``: files that lie in it are named from there, all others absolutely.

        Shipped surfaces keep their names. So a folder that holds scenes and what they need can be moved as a whole.

        Args:
            folder: of the file.
            within: the larger folder that is moved as a whole, where ``folder`` is only a part of it.
        """
        if self.surface is None:
            return self
        here, root = folder.resolve(), (within or folder).resolve()

        def rename(file: Path) -> Path:
            if is_shipped(file):
                return file
            absolute = (self._folder / file).resolve()
            return Path(os.path.relpath(absolute, here)) if absolute.is_relative_to(root) else absolute

        moved = self.model_copy(update={"surface": self.surface.with_files(rename)})
        moved._folder = folder
        return moved

    def in_folder(self, folder: Path) -> Scene:
        """The same scene as if its file lay in ``folder``: that is where its relative file names start."""
        moved = self.model_copy()
        moved._folder = folder
        return moved

    def with_frames(self, frames: int) -> Scene:
        """The same scene over another number of frames."""
        return self.model_copy(update={"frames": frames})

    def build_surface(self) -> Surface | None:
        """The signed distance of the solid, or None for an empty container.

        Raises:
            InputError: a mesh file is missing or not usable.
        """
        return None if self.surface is None else self.surface.surface(self._folder)

    def start(self, surface: Surface | None) -> Start:
        """The particles at the start, those in the way of the solid or of each other left out.

        Raises:
            InputError: a block reaches out of the container, or no particle is left.
        """
        blocks, velocities, placed, left_out = [], [], np.empty((0, 3), np.float32), 0
        for number, entry in enumerate(self.fluid):
            self._check_inside_container(number, entry.block)
            positions = entry.block.positions()
            free = np.ones(len(positions), dtype=bool)
            if surface is not None:
                with torch.no_grad():
                    free &= (surface.distance(torch.from_numpy(positions)) >= SURFACE_CLEARANCE).numpy()
            if len(placed):
                free &= cKDTree(placed).query(positions)[0] > 0.9 * SPACING
            left_out += int((~free).sum())
            if free.any():
                blocks.append(positions[free])
                velocities.append(entry.block.velocity)
                placed = np.concatenate([placed, positions[free]])
        if not blocks:
            raise InputError(
                f"fluid: all {left_out} particles lie in the solid; move the block or make the surface smaller"
            )
        return Start(blocks, velocities, left_out)

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


def checked_block(lower: Vector, upper: Vector) -> Block:
    """The block of fluid between two corners, meters.

    Raises:
        InputError: it is too thin or a number is not finite.
    """
    try:
        return Block(min=lower, max=upper)
    except ValidationError as error:
        raise InputError(f"block of water: {one_line(error, Block)}") from None


def checked_container(size: Vector | None) -> Container:
    """The container of ``size`` meters, the standard one for None.

    Raises:
        InputError: a side is not above zero or not finite.
    """
    if size is None:
        return Container()
    try:
        return Container(size=size)
    except ValidationError as error:
        raise InputError(f"container: {one_line(error, Container)}") from None
