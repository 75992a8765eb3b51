"""Sets of shapes for a DeepSDF: meshes in a folder, or procedural chairs and bowls."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Literal

import numpy as np

from surfsup.datasets.procedural.chairs import chair
from surfsup.errors import InputError
from surfsup.fitting.exact_shape import ExactMesh, ExactShape, ExactSurface
from surfsup.sdf import Bowl, load_mesh
from surfsup.sdf.mesh.mesh_file import FORMATS

SHAPENET_MODEL = "models/model_normalized.obj"  # of ShapeNetCore.v2
SHAPENET_V1_MODEL = "model.obj"
UpAxis = Literal["y", "z"]
CAPTURE_RADIUS = (0.07, 0.3)  # meters; range of a bowl, as in the recipe 'bowls'
MAX_FILTER_SHARE = 0.6  # radius of a bowl's hole, relative to its capture radius
WALL_SHARE = (0.15, 0.3)  # thickness of a bowl's wall, likewise


class ShapeSet(ABC):
    """Named shapes.

    Attributes:
        names: of all shapes, in order.
    """

    names: list[str]

    @abstractmethod
    def shape(self, name: str) -> ExactShape:
        """The shape called ``name``.

        Raises:
            InputError: its file cannot be used.
        """


class Chairs(ShapeSet):
    """Procedural chairs; the number of a chair is its seed."""

    def __init__(self, count: int, first: int = 0) -> None:
        self.names = [f"chair-{number:04d}" for number in range(first, first + count)]

    def shape(self, name: str) -> ExactShape:
        """The chair called ``name``."""
        return ExactSurface(chair(np.random.default_rng([1, int(name.split("-")[1])])).surface())


class Bowls(ShapeSet):
    """Bowls of various radii and walls, every second one with a hole; the number of a bowl is its seed."""

    def __init__(self, count: int, first: int = 0) -> None:
        self.names = [f"bowl-{number:04d}" for number in range(first, first + count)]

    def shape(self, name: str) -> ExactShape:
        """The bowl called ``name``."""
        number = int(name.split("-")[1])
        random = np.random.default_rng([2, number])
        capture = random.uniform(*CAPTURE_RADIUS)
        hole = random.uniform(0.1, MAX_FILTER_SHARE) * capture if number % 2 else 0.0
        return ExactSurface(Bowl(capture, hole, random.uniform(*WALL_SHARE) * capture))


class MeshFolder(ShapeSet):
    """Meshes in a folder, or in subfolders as in ShapeNetCore: <model>/models/model_normalized.obj.

    Raises:
        InputError: there is no such folder, or no mesh in it.
    """

    def __init__(self, folder: Path, up: UpAxis | None, count: int | None) -> None:
        if not folder.is_dir():
            raise InputError(f"{folder}: is not a folder; give one with meshes, or one of {', '.join(PROCEDURAL)}")
        self.up = up
        nested = [(path.parents[1].name, path) for path in folder.glob(f"*/{SHAPENET_MODEL}")]
        nested = nested or [(path.parent.name, path) for path in folder.glob(f"*/{SHAPENET_V1_MODEL}")]
        flat = [(path.stem, path) for path in folder.iterdir() if path.suffix.lower()[1:] in FORMATS]
        files = dict(sorted(nested or flat))
        if not files:
            suffixes = ", ".join(f".{name}" for name in FORMATS)
            raise InputError(
                f"{folder}: contains no meshes; give a folder of files that end in {suffixes}, or a category of "
                f"ShapeNetCore with <model>/{SHAPENET_MODEL}"
            )
        self.files = dict(list(files.items())[:count])
        self.names = list(self.files)

    def shape(self, name: str) -> ExactShape:
        """The mesh called ``name``."""
        return ExactMesh(load_mesh(self.files[name], up=self.up))


PROCEDURAL: dict[str, type[Chairs] | type[Bowls]] = {"chairs": Chairs, "bowls": Bowls}
DEFAULT_COUNT = 500


def open_shape_set(source: str, up: UpAxis | None, count: int | None, first: int = 0) -> ShapeSet:
    """The shapes of ``source``.

    Args:
        source: 'chairs', 'bowls', or a folder of meshes.
        up: the meshes' own upward axis, "y" or "z".
        count: how many shapes; None takes all of a folder, or 500 procedural ones.
        first: number of the first procedural shape.

    Raises:
        InputError: there is no such folder, or no mesh in it.
    """
    if source in PROCEDURAL and not Path(source).is_dir():
        return PROCEDURAL[source](count or DEFAULT_COUNT, first)
    return MeshFolder(Path(source), up, count)
