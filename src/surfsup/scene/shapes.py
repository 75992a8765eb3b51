"""How a scene file describes a surface: one key names the kind, the rest places it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import torch
from pydantic import BaseModel, ConfigDict, Field, model_validator

from surfsup import sdf

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]


class Description(BaseModel):
    """A part of a scene file: unknown keys are refused, values are checked."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SphereShape(Description):
    """A ball of ``radius`` metres."""

    radius: Length

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Sphere(self.radius)


class BoxShape(Description):
    """A box of the sides ``size`` in metres."""

    size: tuple[Length, Length, Length]

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Box(self.size)


class CylinderShape(Description):
    """A cylinder along z, in metres."""

    radius: Length
    height: Length

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Cylinder(self.radius, self.height)


class ConeShape(Description):
    """A capped cone along z, in metres."""

    height: Length
    bottom_radius: Length
    top_radius: Length = 0.01

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.CappedCone(self.height, self.bottom_radius, self.top_radius)


class TorusShape(Description):
    """A ring around z, in metres."""

    major_radius: Length
    minor_radius: Length

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Torus(self.major_radius, self.minor_radius)


class MeshShape(Description):
    """The triangles of ``file``; ``fit`` is the largest extent in metres, left out: as the file has it.

    A fitted mesh is centred in x and y and stands on z = 0.
    """

    file: Path
    fit: Length | None = None
    up: str | None = Field(default=None, pattern="^[yz]$")

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        mesh = sdf.load_mesh(folder / self.file, up=self.up)
        if self.fit is not None:
            mesh, _ = sdf.fit_mesh(mesh, self.fit)
        return sdf.MeshSurface(mesh)


class Rotation(Description):
    """A turn about ``axis``, right-handed."""

    axis: Vector
    degrees: Finite

    @model_validator(mode="after")
    def axis_has_a_direction(self) -> Rotation:
        """A zero axis turns about nothing."""
        if not any(self.axis):
            raise ValueError("axis must not be zero")
        return self


class Shape(Description):
    """A surface of one kind, scaled, then turned, then moved ``at`` a place in the container (metres)."""

    sphere: SphereShape | None = None
    box: BoxShape | None = None
    cylinder: CylinderShape | None = None
    cone: ConeShape | None = None
    torus: TorusShape | None = None
    mesh: MeshShape | None = None
    union: list[Shape] | None = Field(default=None, min_length=1)
    intersection: list[Shape] | None = Field(default=None, min_length=1)
    difference: list[Shape] | None = Field(default=None, min_length=2, max_length=2)
    scale: Length = 1.0
    rotate: Rotation | None = None
    at: Vector = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def exactly_one_kind(self) -> Shape:
        """A surface is of one kind; which one is the key that is set."""
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none"
            raise ValueError(f"needs exactly one kind of surface ({', '.join(KINDS)}), found {found}")
        return self

    @property
    def kind(self) -> str:
        """The key that is set: which kind of surface this is."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance in the container's frame.

        Args:
            folder: where the relative file names of meshes start.

        Raises:
            InputError: a mesh file is missing or not usable.
        """
        placed_already = self.scale == 1.0 and self.rotate is None and not any(self.at)
        shape = self._own_surface(folder)
        if placed_already:
            return shape
        rotation = sdf.axis_rotation(self.rotate.axis, self.rotate.degrees) if self.rotate else torch.eye(3)
        return sdf.Transformed(shape, rotation, self.at, self.scale)

    def _own_surface(self, folder: Path) -> sdf.Surface:
        for kind, combine in COMBINATIONS.items():
            parts: list[Shape] | None = getattr(self, kind)
            if parts is not None:
                return combine(*(part.surface(folder) for part in parts))
        return getattr(self, self.kind).surface(folder)

    def with_files_from(self, folder: Path) -> Shape:
        """The same shape with every mesh file's path made absolute from ``folder``."""
        changes: dict[str, object] = {}
        if self.mesh is not None:
            changes["mesh"] = self.mesh.model_copy(update={"file": (folder / self.mesh.file).resolve()})
        for kind in COMBINATIONS:
            parts: list[Shape] | None = getattr(self, kind)
            if parts is not None:
                changes[kind] = [part.with_files_from(folder) for part in parts]
        return self.model_copy(update=changes)


COMBINATIONS = {"union": sdf.Union, "intersection": sdf.Intersection, "difference": sdf.Difference}
KINDS = ("sphere", "box", "cylinder", "cone", "torus", "mesh", *COMBINATIONS)
