"""Surfaces: solids as signed distance functions."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surfsup.sdf.boxes import Boxes
    from surfsup.sdf.combine import Difference, Intersection, Union
    from surfsup.sdf.heightfield import Heightfield
    from surfsup.sdf.marching_cubes import polygonize
    from surfsup.sdf.mesh.cleaning import MeshWarning
    from surfsup.sdf.mesh.mesh_file import fit_mesh, load_mesh
    from surfsup.sdf.mesh.surface import MeshSurface
    from surfsup.sdf.mesh.thicken import thicken_sheets
    from surfsup.sdf.neural.deepsdf import DeepSdf, DeepSdfSurface, load_deepsdf, save_deepsdf
    from surfsup.sdf.neural.shipped_surfaces import shipped_surfaces, surface_path
    from surfsup.sdf.neural.siren import SirenSurface, load_siren, save_siren
    from surfsup.sdf.neural.surface import NeuralSurface, fit_surface
    from surfsup.sdf.primitives import Box, CappedCone, Cylinder, Sphere, Torus
    from surfsup.sdf.surface import Surface
    from surfsup.sdf.terrain_file import load_heights
    from surfsup.sdf.transform import Transformed, axis_rotation
    from surfsup.sdf.vessels import WALL, Bowl, Funnel

# The names and their modules, which are imported when a name is first used: what ships is known without torch.
_MODULES = {
    "Boxes": "boxes",
    **dict.fromkeys(("Difference", "Intersection", "Union"), "combine"),
    "Heightfield": "heightfield",
    "polygonize": "marching_cubes",
    "MeshWarning": "mesh.cleaning",
    **dict.fromkeys(("fit_mesh", "load_mesh"), "mesh.mesh_file"),
    "MeshSurface": "mesh.surface",
    "thicken_sheets": "mesh.thicken",
    **dict.fromkeys(("DeepSdf", "DeepSdfSurface", "load_deepsdf", "save_deepsdf"), "neural.deepsdf"),
    **dict.fromkeys(("shipped_surfaces", "surface_path"), "neural.shipped_surfaces"),
    **dict.fromkeys(("SirenSurface", "load_siren", "save_siren"), "neural.siren"),
    **dict.fromkeys(("NeuralSurface", "fit_surface"), "neural.surface"),
    **dict.fromkeys(("Box", "CappedCone", "Cylinder", "Sphere", "Torus"), "primitives"),
    "Surface": "surface",
    "load_heights": "terrain_file",
    **dict.fromkeys(("Transformed", "axis_rotation"), "transform"),
    **dict.fromkeys(("WALL", "Bowl", "Funnel"), "vessels"),
}

__all__ = [
    "WALL",
    "Bowl",
    "Box",
    "Boxes",
    "CappedCone",
    "Cylinder",
    "DeepSdf",
    "DeepSdfSurface",
    "Difference",
    "Funnel",
    "Heightfield",
    "Intersection",
    "MeshSurface",
    "MeshWarning",
    "NeuralSurface",
    "SirenSurface",
    "Sphere",
    "Surface",
    "Torus",
    "Transformed",
    "Union",
    "axis_rotation",
    "fit_mesh",
    "fit_surface",
    "load_deepsdf",
    "load_heights",
    "load_mesh",
    "load_siren",
    "polygonize",
    "save_deepsdf",
    "save_siren",
    "shipped_surfaces",
    "surface_path",
    "thicken_sheets",
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
