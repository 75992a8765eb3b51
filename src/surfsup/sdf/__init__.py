"""Surfaces: any solid as a signed distance function."""

from surfsup.sdf.combine import Difference, Intersection, Union
from surfsup.sdf.polygonise import to_mesh
from surfsup.sdf.primitives import Box, CappedCone, Cylinder, Sphere, Torus
from surfsup.sdf.surface import Surface
from surfsup.sdf.transform import Transformed, axis_rotation

__all__ = [
    "Box",
    "CappedCone",
    "Cylinder",
    "Difference",
    "Intersection",
    "Sphere",
    "Surface",
    "Torus",
    "Transformed",
    "Union",
    "axis_rotation",
    "to_mesh",
]
