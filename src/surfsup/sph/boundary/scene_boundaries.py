"""The boundary volume maps of a scene: the container's walls and the scene's solid."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from torch import Tensor

from surfsup.errors import InputError
from surfsup.scene import WALL_CELL, Container, Scene
from surfsup.sdf import Box, Surface, Transformed
from surfsup.sdf.true_distance import with_true_distances
from surfsup.sph.boundary.volume_map import VolumeMap, build_volume_map
from surfsup.sph.kernels import KERNEL_SUPPORT

SURFACE_CELL = 0.025  # meters
WALL_MARGIN = 0.1  # meters that a map extends past the walls, so that a particle that slips through is pushed back
MAX_CELLS = 4_000_000  # of the map of a solid that moves: about 2 GB while it is made


class Walls(Surface):
    """The outside of a container as a solid. Its distance is exact inside the container."""

    def __init__(self, container: Container) -> None:
        super().__init__()
        self.inside = Transformed(Box(container.size), translation=(0.0, 0.0, container.size[2] / 2))

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,) to the nearest wall, meters."""
        return -self.inside.distance(points)

    def bounds(self) -> Tensor:
        """The container's box (2, 3), which this solid surrounds."""
        return self.inside.bounds()


def scene_volume_maps(scene: Scene, surface: Surface | None) -> list[VolumeMap]:
    """The volume maps of ``scene``: its container unless it is open, then ``surface`` if there is one.

    Raises:
        InputError: the surface has no point near the container.
    """
    walls = [] if scene.container.open else [wall_map(scene.container.model_copy(update={"motion": None}))]
    return walls if surface is None else [*walls, surface_map(surface, scene.container)]


@lru_cache(maxsize=4)
def wall_map(container: Container) -> VolumeMap:
    """The volume map of the container's walls. Its cells end at every wall, so all corners are alike."""
    size = np.asarray(container.size)
    cell = size / np.maximum(1, np.round(size / WALL_CELL))
    return build_volume_map(Walls(container), container.lower - 2 * cell, container.upper + 2 * cell, cell)


def surface_map(surface: Surface, container: Container) -> VolumeMap:
    """The volume map of ``surface`` where particles can reach it.

    The map needs true distances outside the solid. If the value of ``surface`` is not that, the distance to its
    triangles replaces it.

    Raises:
        InputError: the surface has no point near the container.
    """
    return map_in_container(exact_outside(surface), container)


def exact_outside(surface: Surface) -> Surface:
    """The surface, with true distances for the parts whose value outside is only a bound."""
    return with_true_distances(surface, lambda part: not part.exact_outside)


def map_in_container(surface: Surface, container: Container, depth: float = KERNEL_SUPPORT) -> VolumeMap:
    """The volume map of ``surface`` in a container, from its own value, with cells down to ``depth`` meters inside.

    Raises:
        InputError: the surface has no point near the container.
    """
    lower, upper = surface.bounds().detach().cpu().double().numpy()
    reach = KERNEL_SUPPORT + SURFACE_CELL
    lower = np.maximum(lower - reach, np.asarray(container.lower) - WALL_MARGIN)
    upper = np.minimum(upper + reach, np.asarray(container.upper) + WALL_MARGIN)
    return build_volume_map(surface, lower, upper, np.full(3, SURFACE_CELL), depth)


def whole_map(surface: Surface, name: str, depth: float = KERNEL_SUPPORT) -> VolumeMap:
    """The volume map of all of ``surface``, in its own frame, from its own value, down to ``depth`` meters inside.

    Args:
        surface: a solid that moves.
        name: of the solid, for the message.
        depth: meters.

    Raises:
        InputError: the solid is too large for a map, or has no point.
    """
    lower, upper = surface.bounds().detach().cpu().double().numpy()
    reach = KERNEL_SUPPORT + SURFACE_CELL
    cells = np.prod(np.ceil((upper - lower + 2 * reach) / SURFACE_CELL))
    if not cells <= MAX_CELLS:
        sides = " x ".join(f"{side:.3g}" for side in upper - lower)
        raise InputError(f"surface '{name}' is {sides} m large, too large for a solid that moves; make it smaller")
    return build_volume_map(surface, lower - reach, upper + reach, np.full(3, SURFACE_CELL), depth)
