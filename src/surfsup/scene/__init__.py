"""Scenes: a surface and blocks of fluid in a container."""

from surfsup.scene.fluid import NEAR_SURFACE_DISTANCE, PARTICLE_RADIUS, SPACING, Block, Fluid, InitialParticles
from surfsup.scene.mesh_surface import load_mesh
from surfsup.scene.scene import SURFACE_CLEARANCE, WALL_CELL, WALL_CLEARANCE, Container, Scene
from surfsup.scene.shapes import Shape
from surfsup.scene.units import FRAME_TIME, Units

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
    "Fluid",
    "InitialParticles",
    "Scene",
    "Shape",
    "Units",
    "load_mesh",
]
