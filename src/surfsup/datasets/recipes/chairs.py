"""The recipe ``chairs``: water falls on a chair (supplement, section 5.4).

By default :mod:`surfsup.datasets.procedural.chairs` draws each chair. With ``--source FOLDER`` it is one of
ShapeNetCore, in ``03001627/<model>/models/model_normalized.obj`` below the folder, below the category's own folder or
below the parent of that, with a largest extent of 0.9 m. The container and the block of water are the supplement's. The
chair's random rotation about the vertical and its random place are ours.
"""

from __future__ import annotations

from pathlib import Path

from surfsup.datasets.folder import SURFACES
from surfsup.datasets.procedural.chairs import chair
from surfsup.datasets.recipes.mesh_files import copy_meshes, fitted_vertices
from surfsup.datasets.recipes.placement import bounding_box_corners, place_on_floor
from surfsup.datasets.recipes.recipe import Random, Recipe
from surfsup.datasets.recipes.water import block_above
from surfsup.errors import InputError
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import MeshShape

CATEGORY = "03001627"  # ShapeNet's number for chairs
MODEL = "models/model_normalized.obj"
FIT = 0.9  # meters: the largest extent of a chair from ShapeNet
MAX_WIDTH = 0.98  # meters along the container's sides: only a chair from ShapeNet can be wider


class Chairs(Recipe):
    """One chair, rotated and placed at random, under a block of water."""

    name = "chairs"

    def prepare(self, source: Path | None, count: int) -> None:
        """Copy the first ``count`` valid chairs of a ShapeNetCore folder; without a ``source`` there are no files.

        Raises:
            InputError: the folder does not have the layout of ShapeNetCore, or none of its chairs is valid.
        """
        if source is None:
            return
        models = shapenet_models(source)
        if copy_meshes(models, self.folder, count) == 0:
            raise InputError(f"{source}: none of its {len(models)} chairs can be used; see the warnings for why")

    def scene(self, index: int, random: Random) -> Scene:
        """Draw scene ``index``: chairs from ShapeNet alternate, ``random`` determines the rest."""
        container = Container()
        models = sorted((self.folder / SURFACES).glob("*.obj"))
        if models:
            path = models[index % len(models)]
            solid = Shape(mesh=MeshShape(file=path.relative_to(self.folder), fit=FIT, up="y"))
            corners = fitted_vertices(path, FIT, up="y")
        else:
            solid = chair(random)
            corners = bounding_box_corners(solid.surface())
        solid, top = place_on_floor(solid, corners, MAX_WIDTH, container, random)
        water = block_above(top[:2], top[2], container, random)
        return Scene(container=container, surface=solid, fluid=[water]).with_base_folder(self.folder)


def shapenet_models(source: Path) -> list[tuple[str, Path]]:
    """Name and file of each chair below ``source``, in the order of the names.

    Raises:
        InputError: there are none.
    """
    for category in (source, source / CATEGORY, *sorted(source.glob(f"*/{CATEGORY}"))):
        models = sorted((path.parents[1].name, path) for path in category.glob(f"*/{MODEL}"))
        if models:
            return models
    raise InputError(
        f"{source}: holds no chairs; give the folder of ShapeNetCore, in which there is {CATEGORY}/<model>/{MODEL}"
    )
