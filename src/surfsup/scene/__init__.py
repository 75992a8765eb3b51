"""Scenes: surfaces and fluid in a container."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surfsup.scene.container import WALL_CELL, Container
    from surfsup.scene.fill import Fill
    from surfsup.scene.fluid import NEAR_SURFACE_DISTANCE, PARTICLE_RADIUS, SPACING, Block, Fluid, InitialParticles
    from surfsup.scene.liquid import Liquid
    from surfsup.scene.mesh_surface import load_mesh
    from surfsup.scene.particle_file import ParticleFile
    from surfsup.scene.scene import Scene
    from surfsup.scene.shapes import Shape
    from surfsup.scene.start import SURFACE_CLEARANCE, WALL_CLEARANCE
    from surfsup.scene.taps import Drain, Tap
    from surfsup.scene.units import FRAME_TIME, Units

# The names and their modules, which are imported when a name is first used: a scene file is looked at without torch.
_MODULES = {
    **dict.fromkeys(
        (
            "WALL_CELL",
            "Container",
        ),
        "container",
    ),
    "Fill": "fill",
    **dict.fromkeys(
        (
            "NEAR_SURFACE_DISTANCE",
            "PARTICLE_RADIUS",
            "SPACING",
            "Block",
            "Fluid",
            "InitialParticles",
        ),
        "fluid",
    ),
    "Liquid": "liquid",
    "load_mesh": "mesh_surface",
    "ParticleFile": "particle_file",
    "Scene": "scene",
    "Shape": "shapes",
    **dict.fromkeys(
        (
            "SURFACE_CLEARANCE",
            "WALL_CLEARANCE",
        ),
        "start",
    ),
    **dict.fromkeys(
        (
            "Drain",
            "Tap",
        ),
        "taps",
    ),
    **dict.fromkeys(
        (
            "FRAME_TIME",
            "Units",
        ),
        "units",
    ),
}

__all__ = [
    "FRAME_TIME",
    "NEAR_SURFACE_DISTANCE",
    "PARTICLE_RADIUS",
    "SPACING",
    "SURFACE_CLEARANCE",
    "WALL_CELL",
    "WALL_CLEARANCE",
    "Block",
    "Container",
    "Drain",
    "Fill",
    "Fluid",
    "InitialParticles",
    "Liquid",
    "ParticleFile",
    "Scene",
    "Shape",
    "Tap",
    "Units",
    "load_mesh",
]


def __getattr__(name: str) -> object:
    """Import a name from its module."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The names."""
    return sorted({*globals(), *__all__})
