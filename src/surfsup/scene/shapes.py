"""The surface of a scene file: one key names its kind, the others place it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
import torch
from pydantic import Field, model_validator

from surfsup import sdf
from surfsup.errors import InputError
from surfsup.scene.strict_model import Degrees, Finite, Length, Place, StrictModel, Vector
from surfsup.sdf.neural.shipped_surfaces import path_from

if TYPE_CHECKING:
    import trimesh
    from scipy.spatial.transform import Rotation as ScipyRotation


FAR = 100.0  # meters from the origin beyond which a mesh is centered: single precision errs by 0.01 mm there


class PrimitiveShape(StrictModel):
    """A solid with a closed form. Its fields are the arguments of ``surface_type``, in the same order."""

    surface_type: ClassVar[Callable[..., sdf.Surface]]

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """Build the surface; ``folder`` is the base of relative paths."""
        return type(self).surface_type(*dict(self).values())


class SphereShape(PrimitiveShape):
    """A sphere, in meters."""

    surface_type = sdf.Sphere
    radius: Length


class BoxShape(PrimitiveShape):
    """A box; ``size`` holds its sides along x, y and z in meters."""

    surface_type = sdf.Box
    size: tuple[Length, Length, Length]


class CylinderShape(PrimitiveShape):
    """A cylinder along z, in meters."""

    surface_type = sdf.Cylinder
    radius: Length
    height: Length


class ConeShape(PrimitiveShape):
    """A capped cone along z, in meters."""

    surface_type = sdf.CappedCone
    height: Length
    bottom_radius: Length
    top_radius: Length = 0.01


class TorusShape(PrimitiveShape):
    """A torus around z, in meters."""

    surface_type = sdf.Torus
    major_radius: Length
    minor_radius: Length


class BowlShape(PrimitiveShape):
    """A hollow hemisphere below the center of its mouth, in meters; a ``filter_radius`` of 0 closes it."""

    surface_type = sdf.Bowl
    capture_radius: Length
    filter_radius: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    wall: Length = sdf.WALL

    @model_validator(mode="after")
    def check_radii(self) -> BowlShape:
        """Require a hole narrower than the mouth."""
        if self.filter_radius >= self.capture_radius:
            raise ValueError(
                f"filter_radius {self.filter_radius:.4g} must be smaller than capture_radius {self.capture_radius:.4g}"
            )
        return self


class FunnelShape(PrimitiveShape):
    """A cone that narrows into a spout, below the center of its mouth, in meters."""

    surface_type = sdf.Funnel
    capture_radius: Length
    filter_radius: Length
    height: Length = 0.25
    spout: Length = 0.1
    wall: Length = sdf.WALL


class MeshShape(StrictModel):
    """The triangles in ``file``.

    ``fit`` scales the largest extent to that many meters, centers the mesh in x and y and puts it on z = 0. Without it
    the mesh keeps its own coordinates, in meters. ``up`` is the upward axis of the file. ``thicken`` makes walls of
    that thickness, in meters, of all open parts; ``fit`` then is the extent with these walls.
    """

    file: Path
    fit: Length | None = None
    up: Literal["y", "z"] | None = None
    thicken: Length | None = None

    def mesh(self, folder: Path = Path()) -> trimesh.Trimesh:
        """Read and place the triangles; ``folder`` is the base of relative paths."""
        mesh = sdf.load_mesh(folder / self.file, up=self.up, keep_sheets=self.thicken is not None)
        if self.thicken is None:
            return mesh if self.fit is None else sdf.fit_mesh(mesh, self.fit)[0]
        if self.fit is not None:
            if self.fit <= self.thicken:
                raise InputError(f"{folder / self.file}: fit {self.fit:.3g} must exceed thicken {self.thicken:.3g}")
            mesh, _ = sdf.fit_mesh(mesh, self.fit - self.thicken)
        mesh = sdf.thicken_sheets(mesh, self.thicken, str(folder / self.file))
        return mesh if self.fit is None else sdf.fit_mesh(mesh, self.fit)[0]

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """Build the surface; ``folder`` is the base of relative paths."""
        return sdf.MeshSurface(self.mesh(folder))


class SirenShape(StrictModel):
    """The SIREN in ``file``, which may be the name of a shipped one.

    ``fit`` scales the largest extent to that many meters, centers the solid in x and y and puts it on z = 0. Without it
    the solid has the size and place of the shape that the network was fitted to.
    """

    file: Path
    fit: Length | None = None

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """Build the surface; ``folder`` is the base of relative paths."""
        siren = sdf.load_siren(path_from(folder, self.file))
        return siren.in_original_units() if self.fit is None else sdf.fit_surface(siren, self.fit)


class DeepSdfShape(StrictModel):
    """A shape of the DeepSDF in ``file``, which may be the name of a shipped one.

    ``shape`` chooses by name, ``code`` by latent code; a file of a single shape needs neither. ``fit`` scales the
    largest extent to that many meters, centers the solid in x and y and puts it on z = 0. Without it the largest extent
    is 2 m and the bounding box is centered on the origin.
    """

    file: Path
    shape: str | None = None
    code: list[Finite] | None = None
    fit: Length | None = None

    @model_validator(mode="after")
    def check_choice(self) -> DeepSdfShape:
        """Refuse a name together with a code."""
        if self.shape is not None and self.code is not None:
            raise ValueError("give either shape or code, not both")
        return self

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """Build the surface; ``folder`` is the base of relative paths."""
        shapes = sdf.load_deepsdf(path_from(folder, self.file))
        code = shapes.code(self.shape) if self.code is None else torch.tensor(self.code)
        surface = shapes.surface(code).with_grid()
        return surface if self.fit is None else sdf.fit_surface(surface, self.fit)


class HeightfieldShape(StrictModel):
    """The terrain in ``file``, a solid on z = 0, centered in x and y; row 0 is in the north, at +y.

    All lengths are meters: ``size`` along x and y, ``height`` between the lowest and the highest sample, ``base`` from
    z = 0 to the lowest sample.
    """

    file: Path
    size: tuple[Length, Length]
    height: Length
    base: Length = 0.1

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """Build the surface; ``folder`` is the base of relative paths."""
        path = folder / self.file
        return sdf.Heightfield(sdf.load_heights(path), self.size, self.height, self.base, source=str(path))


class Rotation(StrictModel):
    """A right-handed rotation about ``axis``."""

    axis: Vector
    degrees: Degrees

    @model_validator(mode="after")
    def check_axis(self) -> Rotation:
        """Require a direction."""
        if max(map(abs, self.axis)) < 1e-12:
            raise ValueError("axis must not be zero")
        return self


class Shape(StrictModel):
    """A surface of exactly one kind, scaled, then rotated, then moved by ``at`` (meters)."""

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
    at: Place = (0.0, 0.0, 0.0)

    @model_validator(mode="before")
    @classmethod
    def check_still(cls, values: Any) -> Any:
        """Refuse a motion of a surface without a name of its own."""
        if isinstance(values, dict) and "motion" in values and "motion" not in cls.model_fields:
            raise ValueError(
                "may not have a motion: only a surface with a name of its own moves; "
                "write surfaces: {name: {..., motion: ...}}"
            )
        return values

    @model_validator(mode="after")
    def check_kind(self) -> Shape:
        """Require exactly one kind."""
        given = [kind for kind in KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none"
            raise ValueError(f"needs exactly one kind of surface ({', '.join(KINDS)}), found {found}")
        return self

    @property
    def kind(self) -> str:
        """The kind of surface: the one kind key that has a value."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    def surface(self, folder: Path = Path()) -> sdf.Surface:
        """Build the surface in the coordinates of the container.

        Args:
            folder: base of relative paths.

        Raises:
            InputError: a file is missing or unusable.
        """
        if self.mesh is not None:
            return self.placed_mesh(folder)
        content = getattr(self, self.kind)
        if self.kind in COMBINATIONS:
            if max(map(abs, self.at)) > FAR:
                return COMBINATIONS[self.kind]([part.placed_by(self) for part in content], folder)
            surface = COMBINATIONS[self.kind](content, folder)
        else:
            surface = content.surface(folder)
        if self.scale == 1.0 and self.rotate is None and not any(self.at):
            return surface
        return sdf.Transformed(surface, self.rotation(), self.at, self.scale)

    def placed_mesh(self, folder: Path) -> sdf.Surface:
        """The surface of a mesh; one far from its own origin is centered first, in double precision.

        Coordinates of the Earth, moved into the container by ``at``, so lose nothing to single precision.
        """
        assert self.mesh is not None
        mesh, at = self.mesh.mesh(folder), self.at
        middle = np.asarray(mesh.bounds).mean(axis=0)
        if np.abs(middle).max() > FAR:
            mesh.vertices = np.asarray(mesh.vertices) - middle
            x, y, z = (np.asarray(at) + self.scale * self.scipy_rotation().apply(middle)).tolist()
            at = (x, y, z)
        surface = sdf.MeshSurface(mesh)
        if self.scale == 1.0 and self.rotate is None and not any(at):
            return surface
        return sdf.Transformed(surface, self.rotation(), at, self.scale)

    def placed_by(self, whole: Shape) -> Shape:
        """This part of ``whole``, placed as ``whole`` places it, in double precision.

        Parts in coordinates of the Earth then come into the container one by one, without a sum of large numbers.
        """
        turn, own = whole.scipy_rotation(), self.scipy_rotation()
        x, y, z = (np.asarray(whole.at) + whole.scale * turn.apply(self.at)).tolist()
        vector = (turn * own).as_rotvec()
        angle = float(np.linalg.norm(vector))
        rotate = None if angle == 0 else Rotation(axis=tuple((vector / angle).tolist()), degrees=np.rad2deg(angle))
        return self.model_copy(update={"at": (x, y, z), "rotate": rotate, "scale": whole.scale * self.scale})

    def scipy_rotation(self) -> ScipyRotation:
        """The rotation in double precision."""
        from scipy.spatial.transform import Rotation as ScipyRotation

        if self.rotate is None:
            return ScipyRotation.identity()
        axis = np.asarray(self.rotate.axis)
        return ScipyRotation.from_rotvec(np.deg2rad(self.rotate.degrees) * axis / np.linalg.norm(axis))

    def rotation(self) -> torch.Tensor:
        """The rotation matrix (3, 3)."""
        return sdf.axis_rotation(self.rotate.axis, self.rotate.degrees) if self.rotate else torch.eye(3)

    def map_files(self, function: Callable[[Path], Path]) -> Self:
        """A copy with ``function`` applied to the path of every file."""
        content = getattr(self, self.kind)
        if self.kind in COMBINATIONS:
            changed = [part.map_files(function) for part in content]
        elif "file" in type(content).model_fields:
            changed = content.model_copy(update={"file": function(content.file)})
        else:
            return self
        return self.model_copy(update={self.kind: changed})


def union_of(parts: list[Shape], folder: Path) -> sdf.Surface:
    """The union of ``parts``. Its boxes become one batched surface; furniture has dozens of them."""
    boxes = [(part, part.box.size) for part in parts if part.box is not None and part.scale == 1.0]
    if len(boxes) < 2:
        return sdf.Union(*(part.surface(folder) for part in parts))
    others = [part.surface(folder) for part in parts if part.box is None or part.scale != 1.0]
    batch = sdf.Boxes(
        torch.tensor([size for _, size in boxes]),
        torch.stack([part.rotation() for part, _ in boxes]),
        torch.tensor([part.at for part, _ in boxes]),
    )
    return sdf.Union(batch, *others) if others else batch


def intersection_of(parts: list[Shape], folder: Path) -> sdf.Surface:
    """The intersection of all ``parts``."""
    return sdf.Intersection(*(part.surface(folder) for part in parts))


def difference_of(parts: list[Shape], folder: Path) -> sdf.Surface:
    """The first of two ``parts`` without the second."""
    return sdf.Difference(*(part.surface(folder) for part in parts))


COMBINATIONS = {"union": union_of, "intersection": intersection_of, "difference": difference_of}
KINDS = tuple(key for key in Shape.model_fields if key not in ("scale", "rotate", "at"))
