"""How a scene file describes a surface: one key names the kind, the rest places it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import torch
from pydantic import BaseModel, ConfigDict, Field, model_validator

from surfsup import sdf
from surfsup.sdf.neural.shipped_surfaces import seen_from

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Finite, Finite, Finite]


class Description(BaseModel):
    """A part of a scene file: unknown keys are refused, values are checked."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SphereShape(Description):
    """A ball of ``radius`` meters."""

    radius: Length

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Sphere(self.radius)


class BoxShape(Description):
    """A box of the sides ``size`` in meters."""

    size: tuple[Length, Length, Length]

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Box(self.size)


class CylinderShape(Description):
    """A cylinder along z, in meters."""

    radius: Length
    height: Length

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Cylinder(self.radius, self.height)


class ConeShape(Description):
    """A capped cone along z, in meters."""

    height: Length
    bottom_radius: Length
    top_radius: Length = 0.01

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.CappedCone(self.height, self.bottom_radius, self.top_radius)


class TorusShape(Description):
    """A ring around z, in meters."""

    major_radius: Length
    minor_radius: Length

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Torus(self.major_radius, self.minor_radius)


class BowlShape(Description):
    """A hollow hemisphere that hangs from the center of its mouth, in meters; a ``filter_radius`` of 0 closes it."""

    capture_radius: Length
    filter_radius: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    wall: Length = sdf.WALL

    @model_validator(mode="after")
    def something_is_left(self) -> BowlShape:
        """A hole as wide as the mouth leaves no bowl."""
        if self.filter_radius >= self.capture_radius:
            raise ValueError(
                f"filter_radius {self.filter_radius:.4g} must be smaller than capture_radius {self.capture_radius:.4g}"
            )
        return self

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Bowl(self.capture_radius, self.filter_radius, self.wall)


class FunnelShape(Description):
    """A cone that narrows into a spout and hangs from the center of its mouth, in meters."""

    capture_radius: Length
    filter_radius: Length
    height: Length = 0.25
    spout: Length = 0.1
    wall: Length = sdf.WALL

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        return sdf.Funnel(self.capture_radius, self.filter_radius, self.height, self.spout, self.wall)


class MeshShape(Description):
    """The triangles of ``file``; ``fit`` is the largest extent in meters, left out: as the file has it.

    A fitted mesh is centered in x and y and stands on z = 0.
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


class SirenShape(Description):
    """The SIREN in ``file``; ``fit`` is its largest extent in meters, left out: as what it was fitted to.

    ``file`` may be the name of a shipped one. A fitted one is centered in x and y and stands on z = 0.
    """

    file: Path
    fit: Length | None = None

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        siren = sdf.load_siren(seen_from(folder, self.file))
        return siren.in_own_unit() if self.fit is None else sdf.standing(siren, self.fit)


class DeepSdfShape(Description):
    """A shape of the DeepSDF in ``file``: the one called ``shape``, or the one of the latent ``code``.

    ``file`` may be the name of a shipped one. A file of a single shape needs neither. ``fit`` is the largest extent in
    meters, 2 where it is left out; then the middle of the shape's box is its origin, else it is centered in x and y and
    stands on z = 0.
    """

    file: Path
    shape: str | None = None
    code: list[Finite] | None = None
    fit: Length | None = None

    @model_validator(mode="after")
    def one_way_to_choose(self) -> DeepSdfShape:
        """A name and a code would be two shapes."""
        if self.shape is not None and self.code is not None:
            raise ValueError("give either shape or code, not both")
        return self

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        shapes = sdf.load_deepsdf(seen_from(folder, self.file))
        code = shapes.code(self.shape) if self.code is None else torch.tensor(self.code)
        surface = shapes.surface(code).with_lattice()
        return surface if self.fit is None else sdf.standing(surface, self.fit)


class HeightfieldShape(Description):
    """Terrain out of ``file``, a solid that stands on z = 0 and is centered in x and y; row 0 is north, at +y.

    ``size`` is its extent along x and y, ``height`` what lies between its lowest and its highest sample and ``base``
    what lies below the lowest, all in meters.
    """

    file: Path
    size: tuple[Length, Length]
    height: Length
    base: Length = 0.1

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """The signed distance; ``folder`` is where relative file names start."""
        path = folder / self.file
        return sdf.Heightfield(sdf.load_heights(path), self.size, self.height, self.base, source=str(path))


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
    """A surface of one kind, scaled, then turned, then moved ``at`` a place in the container (meters)."""

    sphere: SphereShape | None = None
    box: BoxShape | None = None
    cylinder: CylinderShape | None = None
    cone: ConeShape | None = None
    torus: TorusShape | None = None
    bowl: BowlShape | None = None
    funnel: FunnelShape | None = None
    mesh: MeshShape | None = None
    siren: SirenShape | None = None
    deepsdf: DeepSdfShape | None = None
    heightfield: HeightfieldShape | None = None
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
        own = getattr(self, self.kind)
        shape = COMBINATIONS[self.kind](own, folder) if self.kind in COMBINATIONS else own.surface(folder)
        return shape if placed_already else sdf.Transformed(shape, self.rotation(), self.at, self.scale)

    def rotation(self) -> torch.Tensor:
        """How the shape is turned, as a matrix (3, 3)."""
        return sdf.axis_rotation(self.rotate.axis, self.rotate.degrees) if self.rotate else torch.eye(3)

    def with_files(self, rename: Callable[[Path], Path]) -> Shape:
        """The same shape, the name of every file in it replaced by what ``rename`` makes of it."""
        own = getattr(self, self.kind)
        if self.kind in COMBINATIONS:
            changed = [part.with_files(rename) for part in own]
        elif "file" in type(own).model_fields:
            changed = own.model_copy(update={"file": rename(own.file)})
        else:
            return self
        return self.model_copy(update={self.kind: changed})


def union_of(parts: list[Shape], folder: Path) -> sdf.Surface:
    """The union of ``parts``; the boxes among them, of which furniture has dozens, are asked all at once."""
    boxes = [part for part in parts if part.box is not None and part.scale == 1.0]
    if len(boxes) < 2:
        return sdf.Union(*(part.surface(folder) for part in parts))
    others = [part.surface(folder) for part in parts if part.box is None or part.scale != 1.0]
    many = sdf.Boxes(
        torch.tensor([part.box.size for part in boxes]),
        torch.stack([part.rotation() for part in boxes]),
        torch.tensor([part.at for part in boxes]),
    )
    return sdf.Union(many, *others) if others else many


def intersection_of(parts: list[Shape], folder: Path) -> sdf.Surface:
    """What all ``parts`` share."""
    return sdf.Intersection(*(part.surface(folder) for part in parts))


def difference_of(parts: list[Shape], folder: Path) -> sdf.Surface:
    """The first of two ``parts`` without the second."""
    return sdf.Difference(*(part.surface(folder) for part in parts))


COMBINATIONS = {"union": union_of, "intersection": intersection_of, "difference": difference_of}
SOLIDS = ("sphere", "box", "cylinder", "cone", "torus", "bowl", "funnel")
KINDS = (*SOLIDS, "mesh", "siren", "deepsdf", "heightfield", *COMBINATIONS)
