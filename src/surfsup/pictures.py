"""The page, the video and the pictures of a trajectory file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from surfsup.errors import InputError
from surfsup.scene import FRAME_TIME, PARTICLE_RADIUS, Scene
from surfsup.sdf import to_mesh
from surfsup.trajectory import Trajectory

SOLID_RESOLUTION = 128

Tell = Callable[[int, int], None]


def solid_of(scene: Scene) -> trimesh.Trimesh | None:
    """The triangles of a scene's solid."""
    surface = scene.build_surface()
    return None if surface is None else to_mesh(surface, SOLID_RESOLUTION)
