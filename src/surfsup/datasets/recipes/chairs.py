"""The recipe ``chairs``: water falls on a chair (supplement, section 5.4).

By default each chair is drawn by `datasets/carpentry.py`. With ``--source FOLDER`` it is one of ShapeNetCore, read as
``03001627/<model>/models/model_normalized.obj`` below the folder, below the category's own folder or below the one
above, scaled to a largest extent of at most 0.9 m. The container and the block above are the supplement's; how a chair
is turned about the vertical and where it stands are drawn at random, which is ours.
"""

from __future__ import annotations

from pathlib import Path

from surfsup.datasets.procedural.chairs import chair
from surfsup.datasets.recipes.mesh_files import SURFACES, collect, fitted_corners
from surfsup.datasets.recipes.placement import box_corners, stand
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.water import Random, block_above
from surfsup.errors import InputError
from surfsup.scene import Container, Scene, Shape
from surfsup.scene.shapes import MeshShape

CATEGORY = "03001627"  # ShapeNet's number for chairs
MODEL = "models/model_normalized.obj"
FIT = 0.9  # meters: the largest extent of a chair out of ShapeNet
WIDEST = 0.98  # meters along the container's sides: only a chair out of ShapeNet can be wider


class Chairs(Recipe):
    """One chair, turned and placed at random, under a block of water."""

    name = "chairs"

    def prepare(self, source: Path | None, count: int) -> None:
        """Copy the first ``count`` usable chairs of a ShapeNetCore folder; without a ``source`` nothing is needed.

        Raises:
            InputError: the folder is not in ShapeNetCore's layout, or no chair in it can be used.
        """
        if source is None:
            return
        models = shapenet_models(source)
        if collect(models, self.folder, count) == 0:
            raise InputError(f"{source}: none of its {len(models)} chairs can be used; see the warnings for why")

    def scene(self, index: int, random: Random) -> Scene:
        """Scene number ``index``: chairs out of ShapeNet take turns, all else is drawn from ``random``."""
        container = Container()
        models = sorted((self.folder / SURFACES).glob("*.obj"))
        if models:
            path = models[index % len(models)]
            solid = Shape(mesh=MeshShape(file=path.relative_to(self.folder), fit=FIT, up="y"))
            corners = fitted_corners(path, FIT, up="y")
        else:
            solid = chair(random)
            corners = box_corners(solid.surface())
        solid, top = stand(solid, corners, WIDEST, container, random)
        water = block_above(top[:2], top[2], container, random)
        return Scene(container=container, surface=solid, fluid=water).with_base_folder(self.folder)


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
