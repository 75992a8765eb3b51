"""What the solver's particles meet, as volume maps: the container's walls and the scene's solid."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from torch import Tensor

from surfsup.scene import WALL_CELL, Container, Scene
from surfsup.sdf import Box, MeshSurface, Surface, Transformed, polygonize
from surfsup.sph.boundary.volume_map import VolumeMap, volume_map
from surfsup.sph.kernels import KERNEL_SUPPORT

SURFACE_CELL = 0.025  # meters
BEYOND = 0.1  # meters that a map reaches past the walls, so that a particle which slips through is brought back
MESH_RESOLUTION = 160  # cells of the triangles of a solid whose own value is only a bound


class Walls(Surface):
    """All that is not in the container, as a solid: its distance is true inside the container."""

    def __init__(self, container: Container) -> None:
        super().__init__()
        self.room = Transformed(Box(container.size), translation=(0.0, 0.0, container.size[2] / 2))

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,) to the nearest wall."""
        return -self.room.distance(points)

    def bounds(self) -> Tensor:
        """The box of the container (2, 3), around which this solid lies."""
        return self.room.bounds()


def boundaries(scene: Scene, surface: Surface | None) -> list[VolumeMap]:
    """The maps of ``scene``: of its container, and of ``surface`` where there is one.

    Raises:
        InputError: the surface has no point near the container.
    """
    walls = wall_map(scene.container)
    return [walls] if surface is None else [walls, surface_map(surface, scene.container)]


@lru_cache(maxsize=4)
def wall_map(container: Container) -> VolumeMap:
    """The map of the container's walls, whose cells end at all of them: so all corners are alike."""
    size = np.asarray(container.size)
    cell = size / np.maximum(1, np.round(size / WALL_CELL))
    return volume_map(Walls(container), container.lower - 2 * cell, container.upper + 2 * cell, cell)


def surface_map(surface: Surface, container: Container) -> VolumeMap:
    """The map of ``surface`` where particles can meet it.

    The solver needs true distances outside the solid. Where ``surface`` tells only a bound, as beside the edges
    that a difference cuts, its triangles tell them.

    Raises:
        InputError: the surface has no point near the container.
    """
    felt = surface if surface.exact_outside else MeshSurface(polygonize(surface, MESH_RESOLUTION), exact=True)
    return map_in(felt, container)


def map_in(surface: Surface, container: Container, depth: float = KERNEL_SUPPORT) -> VolumeMap:
    """The map of ``surface`` in a container, by its own value, with cells down to a ``depth`` in meters.

    Raises:
        InputError: the surface has no point near the container.
    """
    lower, upper = surface.bounds().detach().cpu().double().numpy()
    reach = KERNEL_SUPPORT + SURFACE_CELL
    lower = np.maximum(lower - reach, np.asarray(container.lower) - BEYOND)
    upper = np.minimum(upper + reach, np.asarray(container.upper) + BEYOND)
    return volume_map(surface, lower, upper, np.full(3, SURFACE_CELL), depth)
