"""Recipes: each file draws the scenes of one kind of data set."""

from surfsup.datasets.recipes.assorted import Assorted
from surfsup.datasets.recipes.bowls import Bowls
from surfsup.datasets.recipes.chairs import Chairs
from surfsup.datasets.recipes.complex_scenes import ComplexScenes
from surfsup.datasets.recipes.fine import Fine
from surfsup.datasets.recipes.funnels import Funnels
from surfsup.datasets.recipes.hills import Hills
from surfsup.datasets.recipes.honey import Honey
from surfsup.datasets.recipes.mountain import Mountain
from surfsup.datasets.recipes.pouring import Pouring
from surfsup.datasets.recipes.prim_shapes import PrimShapes
from surfsup.datasets.recipes.prim_unions import PrimUnions
from surfsup.datasets.recipes.recipe import Recipe
from surfsup.datasets.recipes.stirring import Stirring
from surfsup.datasets.recipes.tanks import Tanks
from surfsup.datasets.recipes.taps import Taps
from surfsup.datasets.recipes.tilting import Tilting

RECIPES: dict[str, type[Recipe]] = {
    recipe.name: recipe
    for recipe in (
        PrimShapes,
        PrimUnions,
        Funnels,
        Bowls,
        Chairs,
        ComplexScenes,
        Mountain,
        Assorted,
        Tanks,
        Hills,
        Stirring,
        Taps,
        Pouring,
        Tilting,
        Fine,
        Honey,
    )
}

__all__ = ["RECIPES", "Recipe"]
