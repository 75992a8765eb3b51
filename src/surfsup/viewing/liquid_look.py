"""How a liquid looks: what it swallows of the light behind it, and its own color where it is thick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surfsup.scene import Scene
from surfsup.scene.liquid import LIQUIDS, Color, Liquid

_TINT = 7.0  # 1/m, of absorption where a color is 1/e of the strongest one
_CLEAR = 1.2  # 1/m, of absorption in the strongest color

Rgb = tuple[float, float, float]  # linear, from 0 to 1
DISPLAY_COLOR: Rgb = (0.25, 0.5, 0.8)  # of water, in programs that know one color alone


@dataclass(frozen=True)
class LiquidLook:
    """How a liquid looks.

    Attributes:
        absorption: (3,) float32, 1/m; far above real liquids', because the scene is small. Or (3, M) of M rays.
        scattering: (3,) float32, linear color of the liquid where it is thick; or (3, M).
    """

    absorption: np.ndarray
    scattering: np.ndarray


WATER = LiquidLook(np.array([6.4, 2.6, 1.5], np.float32), np.array([0.05, 0.33, 0.58], np.float32))


def looks_of(scene: Scene) -> list[LiquidLook]:
    """How each liquid of :attr:`surfsup.Scene.mixture` looks, or the only one of a scene."""
    return [look_of(liquid) for liquid in scene.mixture or [scene.liquid]]


def display_colors(scene: Scene) -> list[Rgb]:
    """One color for each liquid of :attr:`surfsup.Scene.mixture`, or for the only one of a scene."""
    colors = [color_of(liquid) for liquid in scene.mixture or [scene.liquid]]
    return [DISPLAY_COLOR if color is None else linear_color(color) for color in colors]


def linear_color(color: Color) -> Rgb:
    """A color of a screen as one of light."""
    red, green, blue = (round(part**2.2, 4) for part in color)
    return red, green, blue


def mixed_look(looks: Sequence[LiquidLook], thicknesses: Sequence[np.ndarray]) -> LiquidLook:
    """How liquids look together whose ``thicknesses`` (M,) a ray passes: absorption and scattering are (3, M)."""
    shares = np.stack([np.maximum(each, np.float32(1e-6)) for each in thicknesses])
    shares /= shares.sum(axis=0)
    absorption, scattering = (
        np.einsum("lc,lm->cm", np.stack([getattr(look, name) for look in looks]), shares)
        for name in ("absorption", "scattering")
    )
    return LiquidLook(absorption, scattering)


def look_of(liquid: Liquid | None) -> LiquidLook:
    """How the liquid of a scene looks: by its color, or by that of the liquid with a name that has its viscosity."""
    color = color_of(liquid)
    if color is None:
        return WATER
    linear = np.maximum(np.array(color, np.float32) ** np.float32(2.2), np.float32(0.01))
    return LiquidLook(_CLEAR - np.float32(_TINT) * np.log(linear / linear.max()), linear)


def color_of(liquid: Liquid | None) -> Color | None:
    """The color of a liquid, gamma-encoded, from 0 to 1; None for that of water."""
    if liquid is None or liquid.color is not None:
        return None if liquid is None else liquid.color
    named = (each.color for each in LIQUIDS.values() if each.viscosity == liquid.viscosity)
    return next(named, None)
