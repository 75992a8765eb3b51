"""Particles and triangles as unstructured grids of VTK."""

from __future__ import annotations

import numpy as np
import pyvista
from vtkmodules.util.numpy_support import numpy_to_vtk

from surfsup.exporting.frames import ParticleFrame
from surfsup.exporting.mesh_frame import MeshFrame


def particle_grid(frame: ParticleFrame) -> pyvista.UnstructuredGrid:
    """One vertex cell for each particle, with ``velocity``, ``id``, ``radius``, and of several liquids ``liquid``."""
    count = len(frame.positions)
    cells = np.column_stack([np.ones(count, np.int64), np.arange(count)]).ravel()
    grid = pyvista.UnstructuredGrid(cells, np.full(count, pyvista.CellType.VERTEX, np.uint8), frame.positions)
    add_point_data(grid, "velocity", frame.velocities)
    add_point_data(grid, "id", frame.ids)
    add_point_data(grid, "radius", np.full(count, frame.radius, np.float32))
    if frame.liquids is not None:
        add_point_data(grid, "liquid", frame.liquids)
    return grid


def triangle_grid(frame: MeshFrame) -> pyvista.UnstructuredGrid:
    """Triangles with ``velocity`` and ``normal`` at their vertices."""
    count = len(frame.triangles)
    cells = np.column_stack([np.full(count, 3, np.int64), frame.triangles]).ravel()
    grid = pyvista.UnstructuredGrid(cells, np.full(count, pyvista.CellType.TRIANGLE, np.uint8), frame.vertices)
    add_point_data(grid, "velocity", frame.velocities)
    add_point_data(grid, "normal", frame.normals)
    return grid


def add_point_data(grid: pyvista.UnstructuredGrid, name: str, values: np.ndarray) -> None:
    """Add a value or vector for each point, also if there are no points, which pyvista refuses."""
    array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    array.SetName(name)
    grid.GetPointData().AddArray(array)


def as_bytes(text: str | bytes) -> bytes:
    """A string of VTK as bytes; its binding returns text if the bytes happen to be UTF-8."""
    return text.encode() if isinstance(text, str) else text
