"""The materials of a scene file of SPlisHSPlasH as our liquids."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from surfsup.scene.units import Units
from surfsup.sph.dfsph import VISCOSITY
from surfsup.sph.liquid import ADHESION_OF_COEFFICIENT, NO_SLIP, REST_DENSITY, TENSION_OF_COEFFICIENT, VISCOSITY_FACTOR
from surfsup.splishsplash.job_files import AKINCI_NAME, AKINCI_TENSION

Json = Mapping[str, Any]
AKINCI_DEFAULTS = (0.05, 0.01)  # surface tension and adhesion
SAME_VISCOSITY = ("Standard viscosity", "Weiler et al. 2018")  # methods whose coefficient is a viscosity in m²/s
NAME = "Fluid"  # of a material and of the fluid, by default


@dataclass(frozen=True)
class Liquids:
    """The liquids of a scene.

    Attributes:
        of_scene: keys of our scene, where all its water is one liquid.
        by_name: keys of our liquid for each material, where they differ.
        missing: phrases about what was omitted.
    """

    of_scene: dict[str, Any] = field(default_factory=dict)
    by_name: dict[str, dict[str, float]] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)

    def of(self, source: Json) -> dict[str, Any]:
        """The key ``liquid`` of a block, a fluid model or an emitter; empty where it is that of the scene."""
        name = source.get("id", NAME)
        return {"liquid": dict(self.by_name[name])} if name in self.by_name else {}


def liquids_of(content: Json, radius: float) -> Liquids:
    """The liquids of the materials that the fluid of a scene has, whose particles have a ``radius`` in meters."""
    sources = [source for key in ("FluidBlocks", "FluidModels", "Emitters") for source in content.get(key, [])]
    used = {source.get("id", NAME) for source in sources}
    materials: dict[str, Json] = {}
    for material in content.get("Materials", []):
        if (name := material.get("id", NAME)) in used:
            materials.setdefault(name, material)
    missing: list[str] = []
    found: dict[str, dict[str, float]] = {}
    for name, material in materials.items():
        density = float(material.get("density0", REST_DENSITY))
        keys = {**viscosity_keys(material, radius, missing), **tension_keys(material, radius, density, missing)}
        found[name] = {**keys, "density": density}
    missing = list(dict.fromkeys(missing))
    if not found:
        return Liquids(missing=missing)
    first, *others = found.values()
    if any(other != first for other in others):
        return Liquids({}, found, missing)
    return Liquids({"liquid": first} if len(first) > 1 else first, {}, missing)


def viscosity_keys(material: Json, radius: float, missing: list[str]) -> dict[str, float]:
    """The viscosity of a material; empty if it has none, or that of water as the solvers have it."""
    if (found := viscosity_of(material)) is None:
        return {}
    viscosity, at_solids, method = found
    if method not in SAME_VISCOSITY:
        missing.append(f"the viscosity of {viscosity:g} ({method})")
        return {}
    of_water = (VISCOSITY, VISCOSITY * Units(radius).viscosity)
    if not viscosity or any(math.isclose(viscosity, one, rel_tol=1e-6) for one in of_water):
        return {}
    friction = min(1.0, at_solids / (NO_SLIP * viscosity))
    return {"viscosity": round(viscosity / VISCOSITY_FACTOR, 12), "friction": round(friction, 9)}


def viscosity_of(material: Json) -> tuple[float, float, str] | None:
    """Coefficient of the viscosity in m²/s, the one at solids, and the method of a material; None if it has none."""
    if not material.get("viscosityMethod", 1):
        return None
    for name, values in material.items():
        if isinstance(values, dict) and "viscosity" in values:
            return float(values["viscosity"]), float(values.get("viscosityBoundary", 0)), name
    return None


def tension_keys(material: Json, radius: float, density: float, missing: list[str]) -> dict[str, float]:
    """Surface tension and adhesion of a material; empty without both, or if its method is not ours."""
    method = int(material.get("surfaceTensionMethod", 0))
    if method == 0:
        return {}
    if method != AKINCI_TENSION:
        missing.append(f"surface tension of another method than {AKINCI_NAME}")
        return {}
    values, (tension, adhesion) = material.get(AKINCI_NAME, {}), AKINCI_DEFAULTS
    # Once, since the tension per density acts; twice, since their force grows with the density.
    factor = Units(radius).tension * (density / REST_DENSITY) ** 2
    keys = {
        "surface_tension": float(values.get("surfaceTension", tension)) * TENSION_OF_COEFFICIENT * factor,
        "adhesion": float(values.get("surfaceTensionBoundary", adhesion)) * ADHESION_OF_COEFFICIENT * factor,
    }
    return {key: round(value, 9) for key, value in keys.items() if value}
