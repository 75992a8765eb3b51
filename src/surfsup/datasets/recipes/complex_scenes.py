"""The recipe ``complex-scenes``: much water falls on a solid with fine detail (supplement, section 5.3).

By default three solids of our own alternate: a coral, a furnished room into which the water falls, and a lion. With
``--source FOLDER`` the meshes in that folder alternate, z up. The container of 2 x 2 x 3 m and a solid within a cube of
2 m are the supplement's. Ours are the largest extent of 1.9 m, which keeps the solid off the walls, the random rotation
about the vertical (except for the room), and the block above it, 0.6 to 0.66 m a side with 6,800 to 9,300 particles.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from surfsup.datasets.folder import SURFACES, atomic_write
from surfsup.datasets.procedural.coral import coral
from surfsup.datasets.procedural.lion import lion
from surfsup.datasets.procedural.room import room
from surfsup.datasets.recipes.mesh_files import copy_meshes, fitted_vertices
from surfsup.datasets.recipes.placement import place_on_floor
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import block_at
from surfsup.errors import InputError
from surfsup.scene import Block, Container, Scene, Shape
from surfsup.scene.shapes import MeshShape
from surfsup.sdf.mesh.mesh_file import FORMATS

CONTAINER = Container(size=(2.0, 2.0, 3.0))
FIT = 1.9  # meters: the largest extent
BLOCK_SIDE = (0.6, 0.66)  # meters
FALL_GAP = (0.1, 0.4)  # meters between the top of the solid and the block
WALL_GAP = 0.12  # meters from the container's walls to the block, so that it falls into the room
PROCEDURAL_MESHES = {"coral.ply": coral, "lion.ply": lion}
SOLIDS = ("coral.ply", "room", "lion.ply")


class ComplexScenes(Recipe):
    """One solid with fine detail under a large block of water."""

    name = "complex-scenes"

    def prepare(self, source: Path | None, count: int) -> None:
        """Copy the valid meshes of a folder; without a ``source`` write our own coral and lion.

        Raises:
            InputError: the source is not a folder, or none of its meshes is valid.
        """
        if source is None:
            for name in set(SOLIDS[:count]) & set(PROCEDURAL_MESHES):
                if not (path := self.folder / SURFACES / name).exists():
                    with atomic_write(path) as partial:
                        PROCEDURAL_MESHES[name]().export(str(partial), file_type="ply")
            return
        files = sorted(path for path in source.glob("*") if path.suffix.lower()[1:] in FORMATS)
        if copy_meshes(((path.stem, path) for path in files), self.folder, count) == 0:
            what = "see the warnings for why" if files else f"it holds no file that ends in {', '.join(FORMATS)}"
            raise InputError(f"{source}: has no mesh that can be used; {what}")

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: the solids alternate, ``random`` determines the rest."""
        files = (self.folder / SURFACES).glob("[!.]*")
        given = sorted(path.name for path in files if path.name not in PROCEDURAL_MESHES)
        names = given or SOLIDS
        name = names[index % len(names)]
        if name == "room":
            solid = room()
            top = np.array([0.0, 0.0, float(solid.surface().bounds()[1, 2])])
        else:
            solid = Shape(mesh=MeshShape(file=Path(SURFACES) / name, fit=FIT))
            vertices = fitted_vertices(self.folder / SURFACES / name, FIT)
            solid, top = place_on_floor(solid, vertices, FIT, CONTAINER, random)
        scene = Scene(container=CONTAINER, surface=solid, fluid=[block_near(top, random)])
        return scene.with_base_folder(self.folder)


def block_near(top: np.ndarray, random: Random) -> Block:
    """A block of water above ``top`` (3,), slightly off to one side, meters."""
    sides = random.uniform(*BLOCK_SIDE, size=3)
    low, high = np.array(CONTAINER.lower[:2]) + WALL_GAP, np.array(CONTAINER.upper[:2]) - WALL_GAP
    corner = np.clip(top[:2] + random.uniform(-0.15, 0.15, size=2) - sides[:2] / 2, low, high - sides[:2])
    return block_at(np.append(corner, top[2] + random.uniform(*FALL_GAP)), sides)
