"""Surfaces: any solid as a signed distance function."""

from surfsup.sdf.boxes import Boxes
from surfsup.sdf.combine import Difference, Intersection, Union
from surfsup.sdf.heightfield import Heightfield, load_heights
from surfsup.sdf.marching_cubes import polygonize
from surfsup.sdf.mesh.mesh_file import MeshWarning, fit_mesh, load_mesh
from surfsup.sdf.mesh.surface import MeshSurface
from surfsup.sdf.neural.deepsdf import DeepSdf, DeepSdfSurface, load_deepsdf, save_deepsdf
from surfsup.sdf.neural.shipped_surfaces import resolve, shipped_surfaces
from surfsup.sdf.neural.siren import SirenSurface, load_siren, save_siren
from surfsup.sdf.neural.surface import NeuralSurface, standing
from surfsup.sdf.primitives import Box, CappedCone, Cylinder, Sphere, Torus
from surfsup.sdf.surface import Surface
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
    "load_deepsdf",
    "load_heights",
    "load_mesh",
    "load_siren",
    "polygonize",
    "resolve",
    "save_deepsdf",
    "save_siren",
    "shipped_surfaces",
    "standing",
]
