"""How C++ code queries a solid: in C++ itself or, for kinds without C++ code, through a Python function."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import torch

from surfsup import native
from surfsup.sdf import Surface

if TYPE_CHECKING:
    from surfsup.sph.environment import Environment

PythonQuery = Callable[[np.ndarray, np.ndarray, np.ndarray | None], None]


def native_query(environment: Environment) -> native.Solid | PythonQuery | None:
    """The solid that stands still as C++ functions take it; None without one."""
    environment = environment.base
    surface = environment.surface
    if surface is None:
        return None
    # Without a boundary map the shape may change between frames, so that a cached solid would be stale.
    solid = surface.native_solid() if environment.boundary_map is None else environment.native_solid
    return python_query(surface) if solid is None else solid


def python_query(surface: Surface) -> PythonQuery:
    """A function that writes distance (N,) and, unless that is None, unit normal (N, 3) at points (N, 3)."""

    def write(points: np.ndarray, distance: np.ndarray, normal: np.ndarray | None) -> None:
        query = torch.from_numpy(points.copy())  # the caller reuses its memory, and a surface may keep the points
        if normal is None:
            distance[:] = surface.distance(query).numpy()
        else:
            distance[:], normal[:] = (value.numpy() for value in surface.distance_and_normal(query))

    return write
