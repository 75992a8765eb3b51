"""How the recipes put a solid of any form on the floor."""

from __future__ import annotations

from itertools import product

import numpy as np

from surfsup.datasets.recipes.prim_shapes import room
from surfsup.datasets.recipes.water import Random
from surfsup.scene import Container, Shape
from surfsup.scene.shapes import Rotation
from surfsup.sdf import Surface


def box_corners(surface: Surface) -> np.ndarray:
    """The eight corners (8, 3) of a surface's bounding box, meters."""
    return np.array(list(product(*surface.bounds().double().numpy().T)))


def stand(
    solid: Shape, corners: np.ndarray, widest: float, container: Container, random: Random
) -> tuple[Shape, np.ndarray]:
    """The solid turned at random about the vertical, somewhere between the walls.

    Args:
        solid: standing on z = 0, not yet turned or moved.
        corners: points (N, 3) whose convex hull holds it, meters.
        widest: meters along the container's sides; where it is wider once it is turned it is made smaller.
        container: what it stands in.
        random: where turn and place come from.

    Returns:
        The solid in its place, and the highest point (3,) of a line through the middle of its box, meters.
    """
    turn = Rotation(axis=(0.0, 0.0, 1.0), degrees=random.uniform(0.0, 360.0))
    turned = solid.model_copy(update={"rotate": turn})
    corners = corners @ turned.rotation().double().numpy().T
    scale = float(min(1.0, widest / np.ptp(corners[:, :2], axis=0).max()))
    lower, upper = scale * corners.min(axis=0), scale * corners.max(axis=0)
    place = np.array([random.uniform(*room(lower[axis], upper[axis], container.size[axis])) for axis in (0, 1)])
    standing = turned.model_copy(update={"scale": scale, "at": (*place.tolist(), 0.0)})
    return standing, np.append(place + (lower + upper)[:2] / 2, upper[2])
