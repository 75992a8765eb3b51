"""Legacy VTK files, binary, of version 4.2: splashsurf does not read 5.1."""

from __future__ import annotations

import pyvista
from vtkmodules.vtkIOLegacy import vtkUnstructuredGridWriter

from surfsup.exporting.frames import ParticleFrame
from surfsup.exporting.mesh_frame import MeshFrame
from surfsup.exporting.vtk_grid import as_bytes, particle_grid, triangle_grid


def particles(frame: ParticleFrame) -> bytes:
    """Particles with ``velocity``, ``id`` and ``radius``."""
    return file_of(particle_grid(frame), frame.time)


def mesh(frame: MeshFrame) -> bytes:
    """Triangles with ``velocity`` and ``normal``."""
    return file_of(triangle_grid(frame), frame.time)


def file_of(grid: pyvista.UnstructuredGrid, time: float) -> bytes:
    """The file of a grid. The time in seconds is in its title: splashsurf reads no file with a field of its own."""
    writer = vtkUnstructuredGridWriter()
    writer.SetHeader(f"surfsup, time {time:.9g} s")
    writer.SetFileVersion(writer.VTK_LEGACY_READER_VERSION_4_2)
    writer.SetFileTypeToBinary()
    writer.SetInputData(grid)
    writer.WriteToOutputStringOn()
    writer.Write()
    return as_bytes(writer.GetOutputStdString())
