"""Surfaces: solids as signed distance functions."""

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
