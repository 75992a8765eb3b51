"""The formats by name."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, get_args

from surfsup.errors import InputError
from surfsup.exporting.up_axis import UpAxis

if TYPE_CHECKING:
    from surfsup.exporting.frames import ParticleFrame
    from surfsup.exporting.mesh_frame import MeshFrame
    from surfsup.exporting.solids import SolidMeshes

Water = Literal["particles", "surface"]
What = Literal["particles", "surface", "solid", "all"]


class Writer(Protocol):
    """Writes an export, frame by frame."""

    def particles(self, frame: ParticleFrame) -> None:
        """Write the particles of the next frame."""

    def surface(self, frame: MeshFrame) -> None:
        """Write the water's surface of the next frame; of several liquids one after the other."""

    def solid(self, frame: MeshFrame) -> None:
        """Write the solid, once, if it stands still."""

    def moving_solids(self, solids: SolidMeshes, time: float, up: UpAxis) -> None:
        """Write the solids of the next frame, at a time in seconds, if they move."""

    def finish(self) -> list[Path]:
        """Complete the export and return the files to open."""

    def close(self) -> None:
        """Remove what is incomplete: after an error, everything but complete files."""


@dataclass(frozen=True)
class Format:
    """A format.

    Attributes:
        name: on the command line.
        module: with its code, in this package. A format with a file for each frame has functions ``particles`` and
            ``mesh`` there, a format with one file for all frames has ``open_writer``.
        water: what it holds of the water. A format that holds surfaces holds the solid too.
        program: what opens it.
        suffix: of the file of a frame; empty for a format with one file for all frames.
        has_keyframes: whether solids that move are nodes with keys in one file, made by ``animated`` of the module.
        collection: suffix of the file that lists the others by time, made by ``collection`` of the module.
        up: its upward axis, unless another is requested.
        up_is_fixed: whether the format itself requires that axis.
        frames_up: upward axis of the frames that its writer gets, if it turns them itself.
        package: module of the extra ``export`` that it needs.
        by_blender: whether Blender's package bpy writes it.
    """

    name: str
    module: str
    water: tuple[Water, ...]
    program: str
    suffix: str = ""
    collection: str = ""
    has_keyframes: bool = False
    up: UpAxis = "z"
    up_is_fixed: bool = False
    frames_up: UpAxis | None = None
    package: str = ""
    by_blender: bool = False

    def load(self, function: str) -> Callable[..., Any]:
        """A function of the format's module."""
        return getattr(import_module(f"surfsup.exporting.{self.module}"), function)

    def check_package(self) -> None:
        """Require the packages that write the format.

        Raises:
            InputError: it is missing.
        """
        if self.package and find_spec(self.package) is None:
            raise InputError(f"the format {self.name} needs a package that is missing: pip install 'surfsup[export]'")
        if self.by_blender and find_spec("bpy") is None:
            raise InputError(f"the format {self.name} needs Blender as a Python package: pip install bpy")

    def contents(self, what: What | None) -> tuple[What, ...]:
        """What is exported for a value of ``--what``; by default the water in the first way that the format has.

        Raises:
            InputError: there is no such value, or the format does not hold that.
        """
        held: tuple[What, ...] = (*self.water, "solid") if "surface" in self.water else self.water
        if what is None:
            return (held[0],) if self.suffix else held
        if what not in get_args(What):
            raise InputError(f"{what!r} cannot be exported; give one of {', '.join(get_args(What))}")
        if what != "all" and what not in held:
            others = ", ".join(form.name for form in FORMATS.values() if what == "solid" or what in form.water)
            raise InputError(f"the format {self.name} holds {' and '.join(held)}, not {what}; these hold it: {others}")
        return held if what == "all" else (what,)

    def up_axis(self, requested: UpAxis | None) -> UpAxis:
        """The upward axis of the frames that are written, which is that of the files unless the writer turns them.

        Raises:
            InputError: the format requires another than the requested one.
        """
        if requested not in (None, "y", "z"):
            raise InputError(f"the upward axis is y or z, not {requested!r}")
        if self.up_is_fixed and requested not in (None, self.up):
            raise InputError(f"the upward axis of {self.name} files is always {self.up}; omit --up")
        return self.frames_up or requested or self.up


MAX_FPS = 10_000
BOTH: tuple[Water, ...] = ("particles", "surface")

FORMATS = {
    form.name: form
    for form in (
        Format("vtk", "legacy_vtk", BOTH, "ParaView, splashsurf", ".vtk"),
        Format("vtu", "vtu", BOTH, "ParaView, by its .pvd file", ".vtu", ".pvd"),
        Format("ply", "ply", BOTH, "Blender, MeshLab, splashsurf", ".ply"),
        Format("bgeo", "bgeo", ("particles",), "Houdini, partio, splashsurf", ".bgeo"),
        Format("npz", "npz", ("particles",), "NumPy", ".npz"),
        Format("usd", "usd", BOTH, "usdview, Omniverse, Houdini, Blender, Maya", package="pxr"),
        Format("blender", "blender", BOTH, "Blender", package="pxr"),
        Format(
            "alembic",
            "alembic",
            BOTH,
            "Houdini, Maya, Cinema 4D",
            up="y",
            up_is_fixed=True,
            frames_up="z",
            package="pxr",
            by_blender=True,
        ),
        Format("obj", "obj", ("surface",), "nearly every 3D program", ".obj"),
        Format("glb", "glb", ("surface",), "web pages, Blender", ".glb", has_keyframes=True, up="y", up_is_fixed=True),
    )
}


def format_named(name: str) -> Format:
    """The format of that name.

    Raises:
        InputError: there is none.
    """
    if name.lower() in FORMATS:
        return FORMATS[name.lower()]
    near = difflib.get_close_matches(name.lower(), FORMATS, n=1, cutoff=0.5)
    guess = f"did you mean {near[0]!r}? " if near else ""
    raise InputError(f"there is no export format {name!r}; {guess}the formats are {', '.join(FORMATS)}")


def check_export(name: str, fps: float) -> Format:
    """The format of that name, which this machine can write at that rate.

    Raises:
        InputError: there is no such format, its package is missing, or the rate is out of range.
    """
    form = format_named(name)
    form.check_package()
    if not 0 < fps <= MAX_FPS:
        raise InputError(f"{fps:g} frames per second cannot be exported; give a number up to {MAX_FPS}")
    return form
