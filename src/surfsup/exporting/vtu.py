"""VTU, the XML files of VTK, and PVD, which lists them by time.

Data are base64 and uncompressed: splashsurf does not read raw data.
"""

from __future__ import annotations

from collections.abc import Iterable
from xml.sax.saxutils import quoteattr

import numpy as np
import pyvista
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

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
    """The file of a grid, with its time in seconds in the field that VTK's readers look for."""
    grid.field_data["TimeValue"] = np.array([time])
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetDataModeToAppended()
    writer.SetCompressorTypeToNone()
    writer.SetHeaderTypeToUInt64()
    writer.SetInputData(grid)
    writer.WriteToOutputStringOn()
    writer.Write()
    return as_bytes(writer.GetOutputString())


def collection(files: Iterable[tuple[float, str]]) -> bytes:
    """A PVD file, which lists files by their time in seconds."""
    lines = [f'    <DataSet timestep="{time:.9g}" file={quoteattr(name)}/>' for time, name in files]
    body = "\n".join(["  <Collection>", *lines, "  </Collection>"])
    return f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n{body}\n</VTKFile>\n'.encode()
