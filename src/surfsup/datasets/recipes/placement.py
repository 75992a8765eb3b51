"""Random orientations and places of solids between the container's walls."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation as ScipyRotation

from surfsup.datasets.recipes.recipe import Random
from surfsup.scene import Container, Shape
from surfsup.scene.shapes import Rotation
from surfsup.sdf import Surface


def bounding_box_corners(surface: Surface) -> np.ndarray:
    """The eight corners (8, 3) of a surface's bounding box, meters."""
    return np.array(list(product(*surface.bounds().double().numpy().T)))


def random_rotation(random: Random) -> Rotation:
    """A rotation, all with equal probability."""
    rotation = ScipyRotation.random(random_state=random).as_rotvec(degrees=True)
    degrees = float(np.linalg.norm(rotation))
    x, y, z = (rotation / degrees).tolist()
    return Rotation(axis=(x, y, z), degrees=degrees)


def random_rotation_about_z(random: Random) -> Rotation:
    """A rotation about the vertical axis."""
    return Rotation(axis=(0.0, 0.0, 1.0), degrees=random.uniform(0.0, 360.0))


def random_place(lower: np.ndarray, upper: np.ndarray, container: Container, random: Random) -> list[float]:
    """Offsets along x and y that keep a solid with the bounds ``lower`` and ``upper`` between the walls, meters.

    A solid that is wider than the container goes into its middle.
    """

    def offset(axis: int) -> float:
        half = container.size[axis] / 2
        low, high = -half - lower[axis], half - upper[axis]
        if low >= high:
            low = high = (low + high) / 2
        return random.uniform(low, high)

    return [offset(0), offset(1)]


def place_on_floor(
    solid: Shape, corners: np.ndarray, max_width: float, container: Container, random: Random
) -> tuple[Shape, np.ndarray]:
    """Rotate a solid at random about the vertical and place it at random between the walls.

    Args:
        solid: standing on z = 0, not yet rotated or moved.
        corners: points (N, 3) whose convex hull contains the solid, meters.
        max_width: along the container's sides, meters; a solid that is wider after the rotation is scaled down.
        container: the container.
        random: generator of the random numbers.

    Returns:
        The placed solid, and the highest point (3,) on the vertical line through the middle of its box, meters.
    """
    rotated = solid.model_copy(update={"rotate": random_rotation_about_z(random)})
    corners = corners @ rotated.rotation().double().numpy().T
    scale = float(min(1.0, max_width / np.ptp(corners[:, :2], axis=0).max()))
    lower, upper = scale * corners.min(axis=0), scale * corners.max(axis=0)
    place = np.array(random_place(lower, upper, container, random))
    placed = rotated.model_copy(update={"scale": scale, "at": (*place.tolist(), 0.0)})
    return placed, np.append(place + (lower + upper)[:2] / 2, upper[2])
