"""The shapes that a DeepSDF is fitted to: meshes in a folder, or the project's own chairs and bowls."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path

import numpy as np

from surfsup.datasets.procedural.chairs import chair
from surfsup.errors import InputError
from surfsup.fitting.exact import Exact, ExactMesh, ExactSolid
from surfsup.sdf import Bowl, load_mesh
from surfsup.sdf.mesh.mesh_file import FORMATS

SHAPENET_MODEL = "models/model_normalized.obj"  # of ShapeNetCore.v2; version 1 has model.obj beside its textures
SHAPENET_OLD_MODEL = "model.obj"
CAPTURE_RADIUS = (0.07, 0.3)  # meters; as of the recipe 'bowls'
FILTER_SHARE = 0.6  # largest hole of a bowl, of its capture radius
WALLS = (0.15, 0.3)  # of the capture radius


class ShapeSet(ABC):
    """Shapes by name.

    Attributes:
        names: of all of them, in order.
    """

    names: list[str]

    @abstractmethod
    def exact(self, name: str) -> Exact:
        """The shape called ``name``.

        Raises:
            InputError: its file cannot be used.
        """


class Chairs(ShapeSet):
    """Chairs of the project's own carpentry, each drawn by its number."""

    def __init__(self, count: int, first: int = 0) -> None:
        self.names = [f"chair-{number:04d}" for number in range(first, first + count)]

    def exact(self, name: str) -> Exact:
        """The chair called ``name``."""
        return ExactSolid(chair(np.random.default_rng([1, int(name.split("-")[1])])).surface())


class Bowls(ShapeSet):
    """Bowls of all radii and walls, every second one with a hole, each drawn by its number."""

    def __init__(self, count: int, first: int = 0) -> None:
        self.names = [f"bowl-{number:04d}" for number in range(first, first + count)]

    def exact(self, name: str) -> Exact:
        """The bowl called ``name``."""
        number = int(name.split("-")[1])
        random = np.random.default_rng([2, number])
        capture = random.uniform(*CAPTURE_RADIUS)
        hole = random.uniform(0.1, FILTER_SHARE) * capture if number % 2 else 0.0
        return ExactSolid(Bowl(capture, hole, random.uniform(*WALLS) * capture))


class MeshFolder(ShapeSet):
    """Meshes in a folder, or in ShapeNetCore's layout below it: <model>/models/model_normalized.obj.

    Raises:
        InputError: it is no folder, or no mesh is in it.
    """

    def __init__(self, folder: Path, up: str | None, count: int | None) -> None:
        if not folder.is_dir():
            raise InputError(f"{folder}: is no folder; give one with meshes, or one of {', '.join(OWN)}")
        self.up = up
        nested = [(path.parents[1].name, path) for path in folder.glob(f"*/{SHAPENET_MODEL}")]
        nested = nested or [(path.parent.name, path) for path in folder.glob(f"*/{SHAPENET_OLD_MODEL}")]
        flat = [(path.stem, path) for path in folder.iterdir() if path.suffix.lower()[1:] in FORMATS]
        files = dict(sorted(nested or flat))
        if not files:
            endings = ", ".join(f".{name}" for name in FORMATS)
            raise InputError(
                f"{folder}: holds no meshes; give a folder of files that end in {endings}, or a category of "
                f"ShapeNetCore, in which there is <model>/{SHAPENET_MODEL}"
            )
        self.files = dict(list(files.items())[:count])
        self.names = list(self.files)

    def exact(self, name: str) -> Exact:
        """The mesh called ``name``."""
        return ExactMesh(load_mesh(self.files[name], up=self.up))


OWN: dict[str, type[Chairs] | type[Bowls]] = {"chairs": Chairs, "bowls": Bowls}
DEFAULT_COUNT = 500


def shape_set(source: str, up: str | None, count: int | None, first: int = 0) -> ShapeSet:
    """The shapes that ``source`` names: 'chairs', 'bowls', or a folder of meshes.

    Args:
        source: as above.
        up: the meshes' own upward axis, "y" or "z".
        count: how many of them; None takes all of a folder, and 500 of the project's own.
        first: number of the first of the project's own.

    Raises:
        InputError: there is no such folder, or nothing in it.
    """
    if source in OWN and not Path(source).is_dir():
        return OWN[source](count or DEFAULT_COUNT, first)
    return MeshFolder(Path(source), up, count)
