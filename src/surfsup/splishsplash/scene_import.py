"""A scene file of SPlisHSPlasH (JSON) as a scene of ours.

Its walls are a rigid body that is inverted, ours a container whose floor is at z = 0 and whose middle is at x = y = 0;
its upward axis is usually y, ours z. So everything is turned and moved.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml

from surfsup.errors import InputError, single_line
from surfsup.scene import Scene, quaternion
from surfsup.scene.particle_file import read_particles
from surfsup.scene.pose import NO_ROTATION, Pose
from surfsup.sdf import load_mesh
from surfsup.splishsplash.converted_scene import ConvertedScene
from surfsup.splishsplash.emitters import FOREVER, PARTICLES, SPEED, closing_times, opening, turn_of
from surfsup.splishsplash.joints import Hinge, hinges_of, pose_table
from surfsup.splishsplash.materials import Liquids, liquids_of

Y_TO_Z = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # as `up: y` of a mesh
DEFAULTS = {"particleRadius": 0.025, "gravitation": [0.0, -9.81, 0.0]}  # of SPlisHSPlasH
TOLERANCE = 1e-6
MOTOR_SECONDS = 10.0  # of a motor with a sequence of targets, in a scene without an end

Json = Mapping[str, Any]


@dataclass(frozen=True)
class Placement:
    """Where a point of the file is in our scene: p' = turn p + shift.

    Attributes:
        turn: (3, 3), from the file's upward axis to z.
        shift: (3,), meters.
    """

    turn: np.ndarray
    shift: np.ndarray

    def point(self, point: Sequence[float] | np.ndarray) -> np.ndarray:
        """A point, or points (N, 3), in our scene."""
        return np.asarray(point, float) @ self.turn.T + self.shift

    def vector(self, vector: Sequence[float] | np.ndarray) -> list[float]:
        """A velocity or an axis in our scene."""
        return rounded(self.turn @ np.asarray(vector, float))


@dataclass
class Converter:
    """Converts the parts of one scene.

    Attributes:
        source: the file, for messages and relative paths.
        out: the new file.
        missing: phrases about what was omitted.
        files: converted meshes and particles for the folder beside the new file, by path.
    """

    source: Path
    out: Path
    missing: list[str] = field(default_factory=list)
    files: dict[Path, trimesh.Trimesh | np.ndarray | bytes] = field(default_factory=dict)

    def convert(self, content: Json) -> ConvertedScene:
        """Convert the whole scene.

        Raises:
            InputError: a value or a file is unusable.
        """
        settings = {**DEFAULTS, **content.get("Configuration", {})}
        self.note_missing(content, settings)
        gravity = vector_of(settings["gravitation"], "Configuration.gravitation")
        turn = np.eye(3) if abs(gravity[2]) > abs(gravity[1]) else Y_TO_Z
        bodies = content.get("RigidBodies", [])
        walls = [body for body in bodies if body.get("isWall") and body.get("mapInvert", body.get("invertSDF", True))]
        lower, upper = self.box_of(walls[0], turn) if walls else (None, None)
        shift = np.zeros(3) if lower is None else np.array([*-(lower + upper)[:2] / 2, -lower[2]])
        if len(walls) > 1:
            self.missing.append(f"{len(walls) - 1} further boxes of walls")
        placement = Placement(turn, shift)
        scene: dict[str, Any] = {"particle_radius": float(settings["particleRadius"])}
        scene["container"] = "none" if lower is None else {"size": rounded(upper - lower)}
        scene["gravity"] = placement.vector(gravity)
        liquids = liquids_of(content, scene["particle_radius"])
        self.missing += liquids.missing
        scene |= liquids.of_scene
        solids = [body for body in bodies if body not in walls]
        if solids:
            hinges, missing = hinges_of(content)
            self.missing += missing
            duration = float(settings.get("stopAt", 0) or 0)
            scene["surfaces"] = self.surfaces(solids, placement, hinges, duration if duration > 0 else MOTOR_SECONDS)
        fluid = self.fluid(content, placement, liquids)
        taps = self.taps(content, placement, 2 * scene["particle_radius"], liquids)
        if fluid or not taps:
            scene["fluid"] = fluid
        if taps:
            scene["taps"] = taps
        if not fluid and not taps:
            raise InputError(f"{self.source}: has no fluid: no FluidBlocks, no FluidModels, no Emitters")
        if float(settings.get("stopAt", 0) or 0) > 0:
            scene["duration"] = float(settings["stopAt"])
        text = yaml.safe_dump(scene, sort_keys=False, default_flow_style=None)
        Scene.from_yaml(text, str(self.source), self.out.parent)
        text = f"# Converted from {self.source.name} of SPlisHSPlasH.\n{text}"
        return ConvertedScene(text, self.missing, self.out, self.files)

    def note_missing(self, content: Json, settings: Json) -> None:
        """Note what the scene has and ours does not. Settings of the solver and of pictures do not count."""
        self.missing += [f"the animation field {field_name(entry)}" for entry in content.get("AnimationFields", [])]
        if settings.get("sim2D"):
            self.missing.append("two dimensions")
        if settings.get("scriptFile"):
            self.missing.append(f"the script {settings['scriptFile']}")
        materials = content.get("Materials", [])
        for method, name in (
            ("elasticityMethod", "elasticity"),
            ("vorticityMethod", "vorticity"),
            ("dragMethod", "drag of air"),
        ):
            if any(material.get(method) for material in materials):
                self.missing.append(name)

    def box_of(self, body: Json, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner of the walls, with our axes.

        Raises:
            InputError: they are not a box along the axes.
        """
        mesh = self.mesh_of(body)
        vertices = np.asarray(mesh.vertices) * scale_of(body)
        vertices = vertices @ rotation_of(body).T + vector_of(body.get("translation", [0, 0, 0]), "translation")
        vertices = vertices @ turn.T
        lower, upper = vertices.min(axis=0), vertices.max(axis=0)
        on_corners = (np.isclose(vertices, lower, atol=1e-4) | np.isclose(vertices, upper, atol=1e-4)).all()
        volume = abs(mesh.volume) * np.prod(scale_of(body))
        if not (on_corners and math.isclose(volume, np.prod(upper - lower), rel_tol=1e-3)):
            raise InputError(
                f"{self.source}: its walls, {body['geometryFile']}, are no box along the axes; surfsup has boxes only"
            )
        return lower, upper

    def mesh_of(self, body: Json) -> trimesh.Trimesh:
        """The triangles of a rigid body in its own frame."""
        if not isinstance(body.get("geometryFile"), str):
            raise InputError(f"{self.source}: a rigid body has no geometryFile")
        return load_mesh(self.source.parent / body["geometryFile"])

    def surfaces(
        self, bodies: Sequence[Json], placement: Placement, hinges: Mapping[Any, Hinge | None], seconds: float
    ) -> dict[str, Any]:
        """The rigid bodies that are no walls, by name.

        Args:
            bodies: of the file.
            placement: in our scene.
            hinges: of bodies on joints by their ids; None for joints that we do not have.
            seconds: for which motors with a sequence of targets are written.
        """
        surfaces: dict[str, Any] = {}
        for number, body in enumerate(bodies, start=1):
            key = body.get("id", number)
            if body.get("isDynamic") and key in hinges and hinges[key] is None:
                self.missing.append(f"rigid body {number} hangs on a joint; here it stands still")
            elif body.get("isAnimated"):
                self.missing.append(f"rigid body {number} is moved by a script; here it stands still")
            mesh = self.mesh_of(body)
            name = f"{Path(body['geometryFile']).stem}-{number}"
            scale = scale_of(body)
            entry: dict[str, Any]
            if is_box(mesh):
                size = np.abs(placement.turn @ (scale * mesh.extents))
                middle = rotation_of(body) @ (scale * mesh.bounds.mean(axis=0))
                entry = {"box": {"size": rounded(size)}}
            else:
                middle = np.zeros(3)
                entry = {"mesh": self.mesh_entry(name, body, mesh, scale, placement)}
                if np.ptp(scale) < TOLERANCE and not math.isclose(scale[0], 1):
                    entry["scale"] = float(scale[0])
            angle = float(body.get("rotationAngle", 0))
            if angle:
                entry["rotate"] = {"axis": placement.vector(body["rotationAxis"]), "degrees": math.degrees(angle)}
            translation = vector_of(body.get("translation", [0, 0, 0]), "translation")
            entry["at"] = rounded(placement.point(middle + translation))
            if body.get("isDynamic") and (key not in hinges or hinges[key] is not None):
                entry |= self.movement(name, entry, body, placement, hinges.get(key), seconds)
            surfaces[name] = entry
        return surfaces

    def movement(
        self, name: str, entry: Json, body: Json, placement: Placement, hinge: Hinge | None, seconds: float
    ) -> dict[str, Any]:
        """The keys by which a body moves: freely, on an axle, or by a motor."""
        if hinge is None:
            return {"rigid_body": rigid_body(body, placement)}
        point, axis = placement.point(hinge.point), placement.vector(hinge.axis)
        if hinge.rates is None:
            on_axle = rigid_body(body, placement)
            on_axle.pop("velocity", None)
            return {"rigid_body": {**on_axle, "axle": {"axis": axis, "point": rounded(point)}}}
        if len(hinge.rates) == 1:
            return {"motion": {"spin": {"axis": axis, "point": rounded(point), "rate": float(hinge.rates[0, 1])}}}
        turn = entry.get("rotate")
        rest = quaternion.about_axis(turn["axis"], math.radians(turn["degrees"])) if turn else NO_ROTATION
        file = self.beside(f"{name}.csv")
        self.files[file] = pose_table(hinge, Pose.of(entry["at"], rest), point, axis, seconds)
        return {"motion": {"file": self.relative(file), "between": "smooth"}}

    def mesh_entry(
        self, name: str, body: Json, mesh: trimesh.Trimesh, scale: np.ndarray, placement: Placement
    ) -> dict[str, Any]:
        """The mesh of a body: its own file, or a copy scaled along the axes beside the new scene."""
        turned = {"up": "y"} if placement.turn is Y_TO_Z else {}
        if np.ptp(scale) < TOLERANCE:
            return {"file": self.relative(self.source.parent / body["geometryFile"]), **turned}
        scaled = mesh.copy()
        scaled.apply_scale(scale)
        file = self.beside(f"{name}.ply")
        self.files[file] = scaled
        return {"file": self.relative(file), **turned}

    def fluid(self, content: Json, placement: Placement, liquids: Liquids) -> list[Any]:
        """Blocks and files of particles."""
        entries: list[Any] = []
        for block in content.get("FluidBlocks", []):
            scale, shift = (vector_of(block.get(key, default), key) for key, default in
                            (("scale", [1, 1, 1]), ("translation", [0, 0, 0])))  # fmt: skip
            corners = [placement.point(scale * vector_of(block[end], end) + shift) for end in ("start", "end")]
            entry = {"min": rounded(np.minimum(*corners)), "max": rounded(np.maximum(*corners))}
            velocity = placement.vector(block.get("initialVelocity", [0, 0, 0]))
            entries.append({"block": {**entry, "velocity": velocity} if any(velocity) else entry, **liquids.of(block)})
        for number, model in enumerate(content.get("FluidModels", []), start=1):
            if "particleFile" not in model:
                self.missing.append(f"fluid model {number}, which has no particleFile")
                continue
            particles = read_particles(self.source.parent / model["particleFile"])
            own = particles.positions * scale_of(model)
            moved = own @ rotation_of(model).T + vector_of(model.get("translation", [0, 0, 0]), "translation")
            file = self.beside(f"fluid-{number}.npy")
            self.files[file] = placement.point(moved).astype(np.float32)
            velocity = placement.vector(model.get("initialVelocity", [0, 0, 0]))
            placed = {"file": self.relative(file), **({"velocity": velocity} if any(velocity) else {})}
            entries.append({"particles": placed, **liquids.of(model)})
        return entries

    def taps(self, content: Json, placement: Placement, spacing: float, liquids: Liquids) -> list[Any]:
        """The emitters, for particles of a diameter of ``spacing`` meters."""
        emitters = content.get("Emitters", [])
        materials = {material.get("id", "Fluid"): material for material in content.get("Materials", [])}
        flowing = {emitter.get("id", "Fluid"): materials.get(emitter.get("id", "Fluid"), {}) for emitter in emitters}
        if any(material.get("emitterReuseParticles") for material in flowing.values()):
            self.missing.append("emitters that take back particles from outside a box; here they stay")
        limits = {liquid: float(material.get("maxEmitterParticles", PARTICLES)) for liquid, material in flowing.items()}
        taps = []
        duration = float(content.get("Configuration", {}).get("stopAt", 0) or 0)
        ends = closing_times(emitters, spacing, limits, duration if duration > 0 else math.inf)
        for emitter, end in zip(emitters, ends, strict=True):
            axes = placement.turn @ rotation_of(emitter)  # columns: its own axes in our scene
            entry = opening(emitter, spacing)
            translation = vector_of(emitter.get("translation", [0, 0, 0]), "translation")
            entry |= {"at": rounded(placement.point(translation)), "direction": rounded(axes[:, 0])}
            if "rectangle" in entry and (turn := turn_of(axes[:, 0], axes[:, 2])):
                entry["turn"] = turn
            entry["speed"] = float(emitter.get("velocity", SPEED))
            if start := float(emitter.get("emitStartTime", 0)):
                entry["from"] = start
            if end < FOREVER:
                entry["until"] = round(end, 9)
            taps.append({**entry, **liquids.of(emitter)})
        return taps

    def beside(self, name: str) -> Path:
        """The path of a converted file, in a folder beside the new scene."""
        return self.out.with_name(f"{self.out.stem}-files") / name

    def relative(self, file: Path) -> str:
        """A path relative to the new scene where it lies beside it, else absolute."""
        absolute, home = file.resolve(), self.out.parent.resolve()
        return str(absolute.relative_to(home)) if absolute.is_relative_to(home) else str(absolute)


def import_scene(source: Path, out: Path) -> ConvertedScene:
    """Convert the scene file ``source`` of SPlisHSPlasH to the text of the file ``out``, without writing anything.

    Meshes that are scaled along their axes, and particles, go into a folder beside ``out``.

    Raises:
        InputError: the file is no such scene, or a value or a file of it is unusable.
    """
    try:
        content = json.loads(source.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{source}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InputError(f"{source}: is not JSON ({error})") from None
    if not isinstance(content, dict) or not {"Configuration", "FluidBlocks", "FluidModels"} & set(content):
        raise InputError(f"{source}: is no scene of SPlisHSPlasH: it has no Configuration and no fluid")
    try:
        return Converter(source, out).convert(content)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{source}: is no scene of SPlisHSPlasH ({single_line(error)})") from None


def field_name(entry: Json) -> str:
    """What an animation field of a file does."""
    parts = (str(entry.get(f"expression_{axis}", "") or "0") for axis in "xyz")
    return f"of {entry.get('particleField', 'an unknown field')} = ({', '.join(parts)})"


def rigid_body(body: Json, placement: Placement) -> dict[str, Any]:
    """The keys of a rigid body that moves freely. Friction and rebound are ours.

    Raises:
        ValueError: it has no density.
    """
    if "density" not in body:
        raise ValueError(f"the rigid body {body.get('geometryFile')} moves freely and has no density")
    entry: dict[str, Any] = {"density": float(body["density"])}
    for theirs, ours in (("velocity", "velocity"), ("angularVelocity", "angular_velocity")):
        if any(value := placement.vector(vector_of(body.get(theirs, [0, 0, 0]), theirs))):
            entry[ours] = value
    return entry


def is_box(mesh: trimesh.Trimesh) -> bool:
    """Whether all vertices are corners of the box around them, and they enclose it."""
    lower, upper = mesh.bounds
    corners = (np.isclose(mesh.vertices, lower) | np.isclose(mesh.vertices, upper)).all()
    return bool(corners) and math.isclose(abs(mesh.volume), float(np.prod(upper - lower)), rel_tol=1e-6)


def scale_of(entry: Json) -> np.ndarray:
    """The scale (3,) of a body or of a fluid model."""
    return vector_of(entry.get("scale", [1, 1, 1]), "scale")


def rotation_of(entry: Json) -> np.ndarray:
    """The rotation (3, 3) of a body or of a fluid model: an axis, and an angle in radians."""
    angle = float(entry.get("rotationAngle", 0))
    if not angle:
        return np.eye(3)
    axis = vector_of(entry["rotationAxis"], "rotationAxis")
    return np.asarray(trimesh.transformations.rotation_matrix(angle, axis))[:3, :3]


def vector_of(value: object, key: str) -> np.ndarray:
    """Three finite numbers.

    Raises:
        ValueError: there are other values.
    """
    vector = np.asarray(value, float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"{key} must be three numbers, not {value}")
    return vector


def rounded(values: np.ndarray) -> list[float]:
    """Values for a file, without the noise of rotations."""
    return [float(value) for value in np.round(values, 9) + 0.0]
