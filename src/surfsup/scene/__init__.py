"""Scenes: surfaces and fluid in a container."""

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
