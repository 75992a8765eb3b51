"""Liquids: viscosity, surface tension, adhesion, friction at solids, density, color."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from surfsup.scene.strict_model import Density, StrictModel, for_callers_only

Viscosity = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]  # m²/s
Tension = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]  # N/m
Part = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Color = tuple[Part, Part, Part]  # red, green, blue as screens have them (sRGB)
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]


class Liquid(StrictModel):
    """A liquid; ``docs/liquids.md`` describes the keys.

    Attributes:
        viscosity: kinematic, m²/s; by default what the solver needs for calm water, 0.01 m²/s with particles of 15 mm.
        surface_tension: N/m.
        adhesion: work per area that separates the liquid from a solid, N/m.
        friction: of the liquid at solids, from 0, where it slips, to 1, where it does not. Needs a viscosity.
        density: at rest, kg/m³.
        color: in pictures: red, green and blue from 0 to 1; by default that of water, or of the liquid below with the
            same viscosity.

    Raises:
        InputError: a value is out of range.

    Examples:
        >>> import surfsup as sf
        >>> sf.Liquid(viscosity=0.001, surface_tension=0.06).friction
        1.0
    """

    viscosity: Viscosity | None = None
    surface_tension: Tension = 0.0
    adhesion: Tension = 0.0
    friction: Share = 1.0
    density: Density = 1000.0
    color: Color | None = None

    @for_callers_only
    def __init__(
        self,
        viscosity: float | None = None,
        surface_tension: float = 0.0,
        adhesion: float = 0.0,
        friction: float = 1.0,
        density: float = 1000.0,
        color: tuple[float, float, float] | None = None,
    ) -> None:
        super().__init__(
            viscosity=viscosity,
            surface_tension=surface_tension,
            adhesion=adhesion,
            friction=friction,
            density=density,
            color=color,
        )

    @property
    def physics(self) -> Liquid:
        """The same without a color."""
        return self.model_copy(update={"color": None})


# At 20 °C. Water, glycerin: CRC Handbook of Chemistry and Physics. The other two vary: an olive oil; a honey with 17 %
# of water. Their adhesion is that of a liquid at a contact angle of 90° (Young and Dupré: tension times 1 + cos).
LIQUIDS: Mapping[str, Liquid] = {
    "water": Liquid(viscosity=1.0e-6, surface_tension=0.073, adhesion=0.073, density=998.0),
    "oil": Liquid(viscosity=9.0e-5, surface_tension=0.032, adhesion=0.032, density=911.0, color=(0.86, 0.76, 0.25)),
    "glycerin": Liquid(
        viscosity=1.12e-3, surface_tension=0.063, adhesion=0.063, density=1261.0, color=(0.86, 0.9, 0.9)
    ),
    "honey": Liquid(viscosity=7.0e-3, surface_tension=0.055, adhesion=0.055, density=1420.0, color=(0.91, 0.58, 0.1)),
}


def named_liquid(value: Any) -> Any:
    """The liquid of a name; other values as they are.

    Raises:
        ValueError: there is no liquid of that name.
    """
    if value is None or isinstance(value, Liquid | dict):
        return value
    if not isinstance(value, str):
        raise ValueError(f"must be a name out of {', '.join(LIQUIDS)}, or a mapping")
    if value in LIQUIDS:
        return LIQUIDS[value]
    closest = difflib.get_close_matches(value, LIQUIDS, n=1)
    hint = f"did you mean '{closest[0]}'?" if closest else f"known are {', '.join(LIQUIDS)}, or give its properties"
    raise ValueError(f"there is no liquid '{value}'; {hint}")
