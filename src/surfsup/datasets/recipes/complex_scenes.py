"""The recipe ``complex-scenes``: much water falls on a solid of fine detail (supplement, section 5.3).

By default the project's own three take turns: a coral, a furnished room into which the water falls, and a lion. With
``--source FOLDER`` it is every mesh in that folder in turn, z up. The container of 2 x 2 x 3 m and the solid in a cube
of side 2 are the supplement's; that the solid's largest extent is 1.9 m, so that it does not touch the walls, how it is
turned about the vertical (the room is not) and the block of 0.6 to 0.66 m a side above it, which makes 6,800 to 9,300
particles, are ours.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfsup.datasets.procedural.coral import coral
from surfsup.datasets.procedural.lion import lion
from surfsup.datasets.procedural.room import room
from surfsup.datasets.recipes.mesh_files import SURFACES, collect, fitted_corners
from surfsup.datasets.recipes.placement import stand
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import Random, block
from surfsup.errors import InputError
from surfsup.scene import Container, Fluid, Scene, Shape
from surfsup.scene.shapes import MeshShape
from surfsup.sdf.mesh.mesh_file import FORMATS

CONTAINER = Container(size=(2.0, 2.0, 3.0))
FIT = 1.9  # meters: the largest extent
BLOCK_SIDE = (0.6, 0.66)  # meters
FALL_GAP = (0.1, 0.4)  # meters of air between the top of the solid and the block
WALLS = 0.12  # meters from the container's walls to the block, so that it falls into the room
SCULPTED = {"coral.ply": coral, "lion.ply": lion}
TURNS = ("coral.ply", "room", "lion.ply")


class ComplexScenes(Recipe):
    """One solid of fine detail under a large block of water."""

    name = "complex-scenes"

    def prepare(self, source: Path | None, count: int) -> None:
        """Copy the usable meshes of a folder; without a ``source`` sculpt the project's own.

        Raises:
            InputError: the source is no folder, or no mesh in it can be used.
        """
        if source is None:
            for name in set(TURNS[:count]) & set(SCULPTED):
                write_once(self.folder / SURFACES / name, name)
            return
        files = sorted(path for path in source.glob("*") if path.suffix.lower()[1:] in FORMATS)
        if collect(((path.stem, path) for path in files), self.folder, count) == 0:
            what = "see the warnings for why" if files else f"it holds no file that ends in {', '.join(FORMATS)}"
            raise InputError(f"{source}: has no mesh that can be used; {what}")

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``: the solids take turns, all else is drawn from ``random``."""
        given = sorted(path.name for path in (self.folder / SURFACES).glob("[!.]*") if path.name not in SCULPTED)
        turns = given or TURNS
        name = turns[index % len(turns)]
        if name == "room":
            solid = room()
            top = np.array([0.0, 0.0, float(solid.surface().bounds()[1, 2])])
        else:
            solid = Shape(mesh=MeshShape(file=Path(SURFACES) / name, fit=FIT))
            solid, top = stand(solid, fitted_corners(self.folder / SURFACES / name, FIT), FIT, CONTAINER, random)
        return Scene(container=CONTAINER, surface=solid, fluid=[block_over(top, random)]).with_base_folder(self.folder)


def block_over(top: np.ndarray, random: Random) -> Fluid:
    """A block of water above ``top`` (3,), a little to one side of it, meters."""
    sides = random.uniform(*BLOCK_SIDE, size=3)
    low, high = np.array(CONTAINER.lower[:2]) + WALLS, np.array(CONTAINER.upper[:2]) - WALLS
    corner = np.clip(top[:2] + random.uniform(-0.15, 0.15, size=2) - sides[:2] / 2, low, high - sides[:2])
    return block(np.append(corner, top[2] + random.uniform(*FALL_GAP)), sides)


def write_once(path: Path, name: str) -> None:
    """Sculpt ``name`` into the file ``path``, unless it is there."""
    if path.exists():
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.partial")
    partial.write_bytes(SCULPTED[name]().export(file_type="ply"))
    partial.replace(path)
