"""The motion of a surface in a scene file: keyframes, a constant spin, a file of poses, or an animated glTF file."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from surfsup.errors import InputError
from surfsup.scene import quaternion
from surfsup.scene.gltf_motion import GltfMotion
from surfsup.scene.pose import Pose
from surfsup.scene.pose_curve import PoseCurve
from surfsup.scene.shapes import Rotation
from surfsup.scene.strict_model import Finite, Length, StrictModel, Vector

PoseFunction = Callable[[float], Pose]
COLUMNS = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
MAX_TURN = 0.8 * math.pi  # in a frame; half a turn has two shorter ways


def as_quaternion(value: Any) -> Any:
    """A unit quaternion from a quaternion of any length, or from ``axis`` and ``degrees``."""
    if isinstance(value, dict):
        rotation = Rotation.model_validate(value)
        value = quaternion.about_axis(rotation.axis, math.radians(rotation.degrees)).tolist()
    if isinstance(value, list | tuple) and len(value) == 4 and all(isinstance(part, int | float) for part in value):
        return tuple(quaternion.normalized(value).tolist())
    raise ValueError("must be a quaternion [w, x, y, z], or a mapping with axis and degrees")


Quaternion = Annotated[tuple[Finite, Finite, Finite, Finite], BeforeValidator(as_quaternion)]


class Keyframe(StrictModel):
    """The pose at a time. Position or rotation that is left out is that of the surface at rest.

    Attributes:
        time: seconds since the start of the scene.
        position: of the origin of the surface, meters.
        rotation: quaternion [w, x, y, z], or ``axis`` and ``degrees``.
    """

    time: Finite
    position: Vector | None = None
    rotation: Quaternion | None = None


class Spin(StrictModel):
    """A turn at constant rate about ``axis`` through ``point``: ``rate`` in rad/s, or ``turns`` a second."""

    axis: Vector = (0.0, 0.0, 1.0)
    point: Vector | None = None
    rate: Finite | None = None
    turns: Finite | None = None

    @model_validator(mode="after")
    def check_rate(self) -> Spin:
        """Require an axis and one rate."""
        if not any(self.axis):
            raise ValueError("axis must not be zero")
        if (self.rate is None) == (self.turns is None):
            raise ValueError("give either rate in rad/s or turns in turns a second")
        return self

    @property
    def radians_per_second(self) -> float:
        """The rate, rad/s."""
        return self.rate if self.rate is not None else 2 * math.pi * (self.turns or 0.0)

    def check_turn(self, frame_time: float) -> None:
        """Refuse a rate that frames of ``frame_time`` seconds do not resolve.

        Raises:
            ValueError: with the fastest rate.
        """
        limit = MAX_TURN / frame_time
        if abs(self.radians_per_second) > limit * (1 + 1e-9):
            raise ValueError(
                f"turns too fast for frames of {1000 * frame_time:.3g} ms: at most {limit / (2 * math.pi):.3g} turns "
                f"a second ({limit:.4g} rad/s)"
            )

    def pose_function(self, rest: Pose) -> PoseFunction:
        """The pose over time; a spin without ``point`` is about the origin of the surface."""
        point = rest.position if self.point is None else np.array(self.point)

        def pose(time: float) -> Pose:
            turn = quaternion.about_axis(self.axis, self.radians_per_second * time)
            arm = quaternion.matrix(turn) @ (rest.position - point)
            return Pose(point + arm, quaternion.product(turn, rest.rotation))

        return pose


class Motion(StrictModel):
    """How a surface moves: exactly one of ``keyframes``, ``spin``, ``file`` and ``gltf``.

    Attributes:
        keyframes: poses at increasing times.
        spin: a constant turn.
        file: a CSV file of poses with the columns time, x, y, z, qw, qx, qy, qz.
        between: ``smooth`` or ``linear`` between the poses of keyframes and file.
        gltf: a GLB or glTF file with an animation.
        node: of that file, whose motion it is.
        animation: its name; None for all that move the node.
        scale: of the lengths in that file.
        offset: of its origin in the scene, meters.
    """

    keyframes: list[Keyframe] | None = Field(default=None, min_length=1)
    spin: Spin | None = None
    file: Path | None = None
    gltf: Path | None = None
    node: str | None = None
    animation: str | None = None
    scale: Length = 1.0
    offset: Vector = (0.0, 0.0, 0.0)
    between: Literal["smooth", "linear"] = "smooth"

    @model_validator(mode="after")
    def check_kind(self) -> Motion:
        """Require one kind of motion, and keyframes in order."""
        given = [name for name in ("keyframes", "spin", "file", "gltf") if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none"
            raise ValueError(f"needs exactly one of keyframes, spin, file and gltf, found {found}")
        if self.gltf is not None and self.node is None:
            raise ValueError("gltf needs the name of its node: {gltf: FILE, node: NAME}")
        idle = ("between",) if self.gltf is not None else ("node", "animation", "scale", "offset")
        if useless := [name for name in idle if getattr(self, name) != type(self).model_fields[name].default]:
            raise ValueError(f"{useless[0]} has no meaning beside {given[0]}; omit it")
        check_order([key.time for key in self.keyframes or []], "keyframe")
        return self

    def pose_function(self, rest: Pose, folder: Path = Path()) -> PoseFunction:
        """The pose over time of a surface that stands at ``rest`` in the scene file.

        Args:
            rest: ``at`` and ``rotate`` of the surface.
            folder: base of relative paths.

        Raises:
            InputError: the file of poses or the glTF file is missing or unusable.
        """
        if self.spin is not None:
            return self.spin.pose_function(rest)
        if self.gltf is not None and self.node is not None:
            return GltfMotion(folder / self.gltf, self.node, self.animation).pose_function(self.scale, self.offset)
        if self.file is not None:
            times, poses = read_poses(folder / self.file)
        else:
            keys = self.keyframes or []
            times = np.array([key.time for key in keys])
            poses = [
                Pose.of(
                    rest.position if key.position is None else key.position,
                    rest.rotation if key.rotation is None else key.rotation,
                )
                for key in keys
            ]
        return PoseCurve(times, poses, self.between == "smooth").pose

    def map_files(self, function: Callable[[Path], Path]) -> Motion:
        """A copy with ``function`` applied to the path of its file."""
        files = {name: path for name, path in (("file", self.file), ("gltf", self.gltf)) if path is not None}
        return self.model_copy(update={name: function(path) for name, path in files.items()})


def check_order(times: list[float], what: str) -> None:
    """Refuse times that do not increase.

    Raises:
        ValueError: naming the first one that is too early.
    """
    for number in range(1, len(times)):
        if times[number] <= times[number - 1]:
            raise ValueError(
                f"{what} {number} at {times[number]:g} s is not after the one before at {times[number - 1]:g} s; "
                "list them in the order of time"
            )


def read_poses(path: Path) -> tuple[np.ndarray, list[Pose]]:
    """Times (K,) in seconds and poses of a CSV file with the header ``time,x,y,z,qw,qx,qy,qz``.

    Raises:
        InputError: the file is missing, has other columns, or a value is unusable; names the line.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise InputError(f"{path}: cannot be read as a file of poses: {reason}") from None
    if not lines or tuple(cell.strip() for cell in lines[0].split(",")) != COLUMNS:
        raise InputError(f"{path}: the first line of a file of poses is {','.join(COLUMNS)}")
    rows, poses = [], []
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        try:
            row = [float(cell) for cell in line.split(",")]
            if len(row) != len(COLUMNS) or not np.isfinite(row).all():
                raise ValueError(f"it is not {len(COLUMNS)} finite numbers")
            rows.append(row[0])
            poses.append(Pose.of(row[1:4], row[4:]))
            if len(rows) > 1 and rows[-1] <= rows[-2]:
                raise ValueError(f"time {rows[-1]:g} s is not after {rows[-2]:g} s of the line before")
        except ValueError as error:
            raise InputError(f"{path}: line {number}: {error}") from None
    if not poses:
        raise InputError(f"{path}: holds no pose below its first line")
    return np.array(rows), poses
