"""A scene: container, surface, fluid, gravity and frames, as a YAML file or built in Python."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import Field, GetPydanticSchema, PrivateAttr, ValidationError, field_validator, model_validator
from pydantic_core import core_schema

from surfsup.errors import InputError
from surfsup.scene.container import Container
from surfsup.scene.fill import Fill
from surfsup.scene.fluid import PARTICLE_RADIUS, Block, Fluid, InitialParticles
from surfsup.scene.liquid import Liquid, named_liquid
from surfsup.scene.mesh_surface import MeshFileSurface
from surfsup.scene.particle_file import ParticleFile, end_time
from surfsup.scene.scene_file import parse_scene, read_scene_text
from surfsup.scene.shapes import KINDS, Shape
from surfsup.scene.solids import CONTAINER, SINGLE, NamedShape, as_named_shape, build_solids
from surfsup.scene.start import initial_particles
from surfsup.scene.strict_model import Density, Finite, Length, StrictModel, Velocity, for_callers_only
from surfsup.scene.taps import Drain, Passage, Tap
from surfsup.scene.units import Units
from surfsup.scene.validation_error import format_validation_error
from surfsup.sdf import Surface
from surfsup.sdf.neural.shipped_surfaces import is_shipped

MIN_RADIUS, MAX_RADIUS = 1e-3, 0.1  # meters
STANDARD_CONTAINER = Container()


def accept_surface(value: object, validate: core_schema.ValidatorFunctionWrapHandler) -> object:
    """Take a Surface object as it is; validate anything else as a shape description."""
    return value if isinstance(value, Surface) else validate(value)


def accept_named_surface(value: object, validate: core_schema.ValidatorFunctionWrapHandler) -> object:
    """Take a Surface object as it is; validate anything else as a shape that may have a motion."""
    return value if isinstance(value, Surface) else validate(dict(value) if type(value) is Shape else value)


# A file describes a shape; only Python code gives a Surface. So messages about files speak of shapes alone.
SurfaceSchema = GetPydanticSchema(
    lambda _, handler: core_schema.no_info_wrap_validator_function(accept_surface, handler(Shape | None))
)
NamedSchema = GetPydanticSchema(
    lambda _, handler: core_schema.no_info_wrap_validator_function(accept_named_surface, handler(NamedShape))
)


class Scene(StrictModel):
    """What to simulate; ``docs/scene-file.md`` describes the file.

    Attributes:
        fluid: blocks of fluid, filled shapes and vessels, particles of files.
        surface: the solid, as a shape description or a Surface; None for an empty container.
        surfaces: solids by name, instead of ``surface``; these may move.
        container: the box around everything.
        gravity: m/s².
        frames: number of frames in the trajectory.
        particle_radius: half the particle spacing in meters, from 0.001 to 0.1.
        fps: frames per second; by default each frame of the simulator, 5 ms · √(particle_radius / 15 mm), is one.
        duration: seconds, instead of ``frames``.
        restart: a trajectory whose last frame replaces the start of the fluid; time continues.
        taps: from which water enters; ``fluid`` may then be empty.
        drains: in which water leaves.
        forces: names of the solids on which the force of the fluid is recorded, or ``all``. The walls are
            ``container``, a single surface is ``surface``.
        density: of the fluid at rest, kg/m³; that of the liquid, if there is one.
        liquid: what flows, or its name: water, oil, glycerin, honey. By default water as viscous as the solver has it.
            An entry of ``fluid`` or a tap may name another: liquids of a scene do not mix.

    Raises:
        InputError: a value is out of range, ``frames`` and ``duration`` contradict each other, or a name under
            ``forces`` is that of no solid.

    Examples:
        >>> import surfsup as sf
        >>> scene = sf.Scene(surface=sf.Sphere(0.2), fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=100)
        >>> scene.gravity
        (0.0, 0.0, -9.81)
    """

    container: Container = STANDARD_CONTAINER
    surface: Annotated[Shape | Surface | None, SurfaceSchema] = None
    surfaces: dict[str, Annotated[NamedShape | Surface, NamedSchema]] = Field(default_factory=dict)
    fluid: list[Fluid]
    gravity: Velocity = (0.0, 0.0, -9.81)
    frames: int = Field(default=800, ge=1)
    particle_radius: Finite = PARTICLE_RADIUS
    fps: Length | None = None
    duration: Length | None = None
    restart: Path | None = None
    taps: list[Tap] = Field(default_factory=list)
    drains: list[Drain] = Field(default_factory=list)
    forces: Literal["all"] | list[str] = Field(default_factory=list)
    density: Density = 1000.0
    liquid: Liquid | None = None
    _folder: Path = PrivateAttr(default=Path())
    _mixture: tuple[Liquid, ...] | None = PrivateAttr(default=None)

    @for_callers_only
    def __init__(
        self,
        *,
        fluid: Sequence[Block | Fill | ParticleFile | Fluid] = (),
        surface: Shape | Surface | None = None,
        surfaces: Mapping[str, Shape | Surface] | None = None,
        container: Container = STANDARD_CONTAINER,
        gravity: Velocity = (0.0, 0.0, -9.81),
        frames: int | None = None,
        particle_radius: float = PARTICLE_RADIUS,
        fps: float | None = None,
        duration: float | None = None,
        restart: Path | str | None = None,
        taps: Sequence[Tap] = (),
        drains: Sequence[Drain] = (),
        forces: Literal["all"] | Sequence[str] = (),
        density: float | None = None,
        liquid: Liquid | str | None = None,
    ) -> None:
        if isinstance(fluid, StrictModel):
            raise InputError(f"Scene: fluid is a list, as in [{type(fluid).__name__}(...)]")
        entries = [Fluid.of(entry) for entry in fluid]
        given: dict[str, float] = {} if frames is None else {"frames": frames}
        if density is not None:
            given["density"] = density
        super().__init__(
            fluid=entries,
            surface=surface,
            surfaces=dict(surfaces or {}),
            container=container,
            gravity=gravity,
            particle_radius=particle_radius,
            fps=fps,
            duration=duration,
            restart=restart,
            taps=list(taps),
            drains=list(drains),
            forces=forces if forces == "all" else list(forces),
            liquid=liquid,
            **given,
        )

    @model_validator(mode="before")
    @classmethod
    def check_names(cls, values: Any) -> Any:
        """Refuse a single surface beside named ones, and names that mean something else."""
        named = values.get("surfaces") if isinstance(values, dict) else None
        if not isinstance(named, dict) or not named:
            return values
        if values.get("surface") is not None:
            raise ValueError("give either surface or surfaces, not both")
        for name, entry in named.items():
            if name in KINDS and isinstance(entry, dict) and not set(entry) & set(KINDS):
                raise ValueError(
                    f"surfaces: '{name}' is a kind of surface, not a name; write surfaces: {{a-name: {{{name}: ...}}}}"
                )
            if not str(name).strip() or name == CONTAINER or "/" in str(name):
                raise ValueError(f"surfaces: '{name}' cannot be the name of a surface; choose another")
        return values

    @model_validator(mode="before")
    @classmethod
    def allow_empty_start(cls, values: Any) -> Any:
        """A scene with taps may begin without fluid."""
        if isinstance(values, dict) and values.get("taps") and "fluid" not in values:
            return {**values, "fluid": []}
        return values

    @field_validator("particle_radius")
    @classmethod
    def check_radius(cls, radius: float) -> float:
        """Refuse particles beyond the range in which water flows as the solver has it."""
        if not MIN_RADIUS <= radius <= MAX_RADIUS:
            raise ValueError(f"must be from {MIN_RADIUS:g} to {MAX_RADIUS:g} m")
        return radius

    @model_validator(mode="after")
    def check_water(self) -> Scene:
        """Require water, at the start or from taps."""
        if not self.fluid and not self.taps:
            raise ValueError("fluid: is empty, and there are no taps; give water or a tap")
        return self

    @model_validator(mode="after")
    def check_passages(self) -> Scene:
        """Require taps that particles fit through, and carriers that are there."""
        check_passages(self)
        return self

    @model_validator(mode="after")
    def check_blocks(self) -> Scene:
        """Require that every block holds a particle, and not too many."""
        for number, entry in enumerate(self.fluid):
            try:
                if entry.block is None:
                    continue
                entry.block.check_particle_count(self.spacing)
            except ValueError as error:
                raise ValueError(f"fluid.{number}.block: {error}") from None
        return self

    @model_validator(mode="after")
    def check_spins(self) -> Scene:
        """Refuse spins that are too fast for the simulator's frames, whose length is that of the particles' radius."""
        named = {f"surfaces.{name}": getattr(entry, "motion", None) for name, entry in self.surfaces.items()}
        for place, motion in {**named, CONTAINER: self.container.motion}.items():
            try:
                if motion is not None and motion.spin is not None:
                    motion.spin.check_turn(self.units.frame_time)
            except ValueError as error:
                raise ValueError(f"{place}: {error}") from None
        return self

    @field_validator("liquid", mode="before")
    @classmethod
    def find_liquid(cls, value: Any) -> Any:
        """Take a name for the liquid that has it."""
        return named_liquid(value)

    @model_validator(mode="after")
    def take_density(self) -> Scene:
        """Take the density of the liquid."""
        if self.liquid is not None:
            density = self.liquid.density
            if "density" in self.model_fields_set and self.density != density:
                raise ValueError(
                    f"density: {self.density:g} contradicts that of the liquid, {density:g} kg/m³; give it under "
                    "'liquid' alone"
                )
            self.__dict__["density"] = density  # the model is frozen for its users
        return self

    @property
    def mixture(self) -> tuple[Liquid, ...]:
        """The different liquids of the scene in the order of its fluid and taps; empty where none names its own.

        An entry or a tap that names none has that of the scene, or else water as the solver has it.
        """
        if self._mixture is not None:
            return self._mixture
        sources: list[Fluid | Tap] = [*self.fluid, *self.taps]
        if all(source.liquid is None for source in sources):
            return ()
        return tuple(dict.fromkeys(self.liquid_of(source) for source in sources))

    def liquid_of(self, source: Fluid | Tap) -> Liquid:
        """The liquid of an entry of the fluid, or of a tap."""
        return source.liquid or self.liquid or Liquid(density=self.density)

    def with_mixture(self, liquids: tuple[Liquid, ...]) -> Scene:
        """A copy whose :attr:`mixture` is ``liquids``, whatever its fluid says."""
        copy = self.model_copy()
        copy._mixture = liquids
        return copy

    @field_validator("forces", mode="before")
    @classmethod
    def check_forces(cls, names: Any) -> Any:
        """Require ``all`` or names."""
        if names == "all" or (isinstance(names, list) and all(isinstance(name, str) for name in names)):
            return names
        raise ValueError("must be 'all' or a list of names of solids")

    @model_validator(mode="after")
    def check_force_names(self) -> Scene:
        """Refuse forces on solids that are not there."""
        known = self.solid_names
        if unknown := [name for name in self.forces if name not in known and self.forces != "all"]:
            there = ", ".join(known) or "none, and the container is open"
            raise ValueError(f"forces: there is no solid '{unknown[0]}'; those of the scene are {there}")
        return self

    @model_validator(mode="after")
    def count_frames(self) -> Scene:
        """Compute the number of frames from the duration."""
        fastest = 1 / self.units.frame_time
        if self.fps is not None and self.fps > (1 + 1e-6) * fastest:
            raise ValueError(f"fps: must be at most {fastest:.4g} with particles of radius {self.particle_radius:g} m")
        if self.duration is not None:
            frames = max(1, math.ceil(self.duration / self.frame_time - 1e-6))
            if "frames" in self.model_fields_set and self.frames != frames:
                raise ValueError(
                    f"frames: {self.frames} contradicts a duration of {self.duration:g} s, which has {frames} frames "
                    f"of {self.frame_time:.4g} s; give only one of them"
                )
            self.__dict__["frames"] = frames  # the model is frozen for its users
        return self

    @property
    def units(self) -> Units:
        """The units of the scene beside those of the simulators."""
        return Units(self.particle_radius)

    @property
    def spacing(self) -> float:
        """Distance between neighboring particles at the start, meters."""
        return 2 * self.particle_radius

    @property
    def frame_time(self) -> float:
        """Seconds between the frames of the scene's trajectory."""
        return self.units.frame_time if self.fps is None else 1 / self.fps

    @property
    def start_time(self) -> float:
        """The time at which the scene begins, seconds: 0, or the end of the trajectory that it continues."""
        return 0.0 if self.restart is None else end_time(self._folder / self.restart)

    @property
    def base_folder(self) -> Path:
        """The folder where relative paths start."""
        return self._folder

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
        data = parse_scene(text, source)
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
        return cls.from_yaml(read_scene_text(path), str(path), path.parent)

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
        named = {name: as_named_shape(entry) for name, entry in self.surfaces.items()}
        if missing := [name for name, entry in named.items() if entry is None]:
            raise InputError(
                f"scene: a file cannot describe its surface '{missing[0]}', a "
                f"{type(self.surfaces[missing[0]]).__name__} object; give a Shape, or a surface from load_mesh"
            )
        data = self.model_copy(update={"surface": shape, "surfaces": named}).model_dump(
            mode="json", exclude_defaults=True, by_alias=True
        )
        return yaml.safe_dump(data, sort_keys=False, default_flow_style=None)

    @property
    def shape(self) -> Shape | Surface | None:
        """The description of the surface as a file holds it; the surface itself if there is none."""
        return self.surface.shape if isinstance(self.surface, MeshFileSurface) else self.surface

    @property
    def surface_kind(self) -> str:
        """The kind of the surface: a key of a scene file, "none" for no surface, "object" for one without a key.

        Of named surfaces it is "several".
        """
        if self.surfaces:
            return "several"
        shape = self.shape
        return "none" if shape is None else shape.kind if isinstance(shape, Shape) else "object"

    def with_paths_relative_to(self, folder: Path, root: Path | None = None) -> Scene:
        """A copy for a file in ``folder``: paths inside ``root`` become relative to ``folder``, others absolute.

        So a root folder with scenes and their meshes can be moved as a whole. Names of shipped surfaces stay.

        Args:
            folder: folder of the new file.
            root: folder that may be moved as a whole; ``folder`` by default.
        """
        target, inside = folder.resolve(), (root or folder).resolve()

        def relocate(file: Path) -> Path:
            if is_shipped(file):
                return file
            absolute = (self._folder / file).resolve()
            return Path(os.path.relpath(absolute, target)) if absolute.is_relative_to(inside) else absolute

        shape, named = self.shape, {name: as_named_shape(entry) or entry for name, entry in self.surfaces.items()}
        shake = self.container.motion
        changes: dict[str, object] = {
            "surface": shape.map_files(relocate) if isinstance(shape, Shape) else shape,
            "surfaces": {
                name: entry.map_files(relocate) if isinstance(entry, Shape) else entry for name, entry in named.items()
            },
            "fluid": [entry.map_files(relocate) for entry in self.fluid],
            "restart": None if self.restart is None else relocate(self.restart),
            "drains": [drain.map_files(relocate) for drain in self.drains],
        }
        if shake is not None:
            changes["container"] = self.container.model_copy(update={"motion": shake.map_files(relocate)})
        return self.model_copy(update=changes).with_base_folder(folder)

    @property
    def solid_names(self) -> tuple[str, ...]:
        """The names under which forces on solids are recorded."""
        walls = () if self.container.open else (CONTAINER,)
        return *walls, *(() if self.surface is None else (SINGLE,)), *self.surfaces

    @property
    def needs_native(self) -> bool:
        """Whether the scene runs on the CPU unless a device is given: it moves, or has forces or a liquid.

        A GPU cuts no path where it enters a solid, and several liquids need the C++ code.
        """
        return self.moves or bool(self.forces) or self.liquid is not None or bool(self.mixture)

    @property
    def flush(self) -> bool:
        """Whether the water touches a surface (``flush``), which the reference does not know."""
        return any(isinstance(entry, NamedShape) and entry.flush for entry in self.surfaces.values())

    @property
    def moves(self) -> bool:
        """Whether a surface or the container has a motion, or is a rigid body."""
        named = (entry for entry in self.surfaces.values() if isinstance(entry, NamedShape))
        return self.container.motion is not None or any(entry.moves for entry in named)

    @property
    def is_open(self) -> bool:
        """Whether water enters or leaves, so that the number of particles varies."""
        return bool(self.taps or self.drains)

    def with_base_folder(self, folder: Path) -> Scene:
        """A copy whose relative paths start at ``folder``."""
        copy = self.model_copy()
        copy._folder = folder
        return copy

    def with_taps(self, taps: Sequence[Tap]) -> Scene:
        """A copy with other taps.

        Raises:
            InputError: no particle fits through one, or there is no such surface to carry it.
        """
        copy = self.model_copy(update={"taps": list(taps)}).with_base_folder(self.base_folder)
        try:
            check_passages(copy)
        except ValueError as error:
            raise InputError(str(error)) from None
        return copy

    def with_frames(self, frames: int) -> Scene:
        """A copy with another number of frames."""
        return self.model_copy(update={"frames": frames, "duration": None})

    def with_changes(self, **values: float | Path | None) -> Scene:
        """A copy with other values of some attributes; None keeps a value.

        Raises:
            InputError: a value is out of range, or contradicts another.
        """
        changes = {key: value for key, value in values.items() if value is not None}
        if not changes:
            return self
        kept = {key: getattr(self, key) for key in type(self).model_fields}
        kept.pop("frames" if "duration" in changes or self.duration is not None else "duration")
        if "frames" in changes:
            kept["duration"] = None
        return type(self)(**{**kept, **changes}).with_base_folder(self._folder)

    def build_surface(self) -> Surface | None:
        """The signed distance function of all that stands still; None without any.

        Raises:
            InputError: a file of the surface is missing or unusable.
        """
        return build_solids(self).still if self.surfaces else self.build_single_surface()

    def build_single_surface(self) -> Surface | None:
        """The signed distance function of ``surface``."""
        return self.surface.surface(self._folder) if isinstance(self.surface, Shape) else self.surface

    def initial_particles(self, surface: Surface | None) -> InitialParticles:
        """Place the particles of each entry of the fluid, except where they overlap the solid or an earlier entry.

        A scene with ``restart`` has those of the last frame of that trajectory instead.

        Args:
            surface: the solid at the start; that of :meth:`build_surface` if nothing moves.

        Raises:
            InputError: an entry reaches out of the container, a vessel is open, a file is unusable, this machine's
                memory is too small, or no particle remains.
        """
        return initial_particles(self, surface)


def check_passages(scene: Scene) -> None:
    """Require taps that particles fit through, and carriers that are there.

    Raises:
        ValueError: naming the tap or the drain.
    """
    carriers = (*scene.surfaces, CONTAINER)
    passages: dict[str, Sequence[Passage]] = {"taps": scene.taps, "drains": scene.drains}
    for key, entries in passages.items():
        for number, entry in enumerate(entries):
            try:
                if isinstance(entry, Tap):
                    entry.check_opening(scene.spacing)
            except ValueError as error:
                raise ValueError(f"{key}.{number}.{error}") from None
            if entry.carrier is not None and entry.carrier not in carriers:
                known = ", ".join(scene.surfaces) or "none; name them under 'surfaces'"
                raise ValueError(
                    f"{key}.{number}.carrier: there is no surface '{entry.carrier}'; the scene's are {known}"
                )
