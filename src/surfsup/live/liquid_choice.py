"""Which of several liquids is poured, or comes from the tap."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from surfsup.live.world import LiveWorld
from surfsup.scene.liquid import LIQUIDS, Liquid

if TYPE_CHECKING:
    import viser


def liquid_choice(server: viser.ViserServer, world: LiveWorld) -> Callable[[], int]:
    """Add a list of the scene's liquids, where there are several; the result says which one is chosen, by number."""
    liquids = world.scene.mixture
    if len(liquids) < 2:
        return lambda: 0
    names = [f"{number}: {liquid_name(liquid)}" for number, liquid in enumerate(liquids)]
    chosen = server.gui.add_dropdown("liquid", tuple(names))
    return lambda: names.index(chosen.value)


def liquid_name(liquid: Liquid) -> str:
    """The name of a liquid, or its density."""
    return next((name for name, known in LIQUIDS.items() if known == liquid), f"{liquid.density:g} kg/m³")
