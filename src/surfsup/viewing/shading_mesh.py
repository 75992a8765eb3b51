"""The triangles of a solid as they are drawn: with short edges, and normals that are smooth except at sharp edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

_MAX_EDGE = 0.02  # meters; longer edges are split so that a shadow can end inside a triangle
_MAX_FACES = 400_000
_SHARP = 40.0  # degrees between two triangles


@dataclass(frozen=True)
class ShadingMesh:
    """Triangles with normals.

    Attributes:
        vertices: (V, 3) float32, meters.
        faces: (F, 3).
        normals: (V, 3) float32, unit, outwards.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray

    @staticmethod
    def of(solid: trimesh.Trimesh) -> ShadingMesh:
        """The mesh of a solid."""
        from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkPoints
        from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
        from vtkmodules.vtkFiltersCore import vtkPolyDataNormals

        max_edge = max(_MAX_EDGE, float(np.sqrt(solid.area / _MAX_FACES * 4)))
        vertices, faces = trimesh.remesh.subdivide_to_size(
            np.asarray(solid.vertices), np.asarray(solid.faces), max_edge, max_iter=12
        )
        # subdivide_to_size gives every triangle its own vertices; merged vertices share a normal.
        merged = trimesh.Trimesh(vertices, faces, process=True)
        points, cells, mesh = vtkPoints(), vtkCellArray(), vtkPolyData()
        points.SetData(numpy_to_vtk(np.asarray(merged.vertices, np.float32), deep=True))
        cells.SetData(3, numpy_to_vtkIdTypeArray(np.asarray(merged.faces, np.int64).ravel(), deep=True))
        mesh.SetPoints(points)
        mesh.SetPolys(cells)
        normals = vtkPolyDataNormals()
        normals.SetInputData(mesh)
        normals.SetFeatureAngle(_SHARP)
        normals.SplittingOn()
        normals.ConsistencyOff()
        normals.AutoOrientNormalsOff()
        normals.Update()
        result = normals.GetOutput()
        return ShadingMesh(
            vtk_to_numpy(result.GetPoints().GetData()).copy(),
            vtk_to_numpy(result.GetPolys().GetConnectivityArray()).reshape(-1, 3).copy(),
            vtk_to_numpy(result.GetPointData().GetNormals()).copy(),
        )
