"""Off-screen rasterization of triangles with VTK: color and depth only. Lighting is computed in NumPy."""

from __future__ import annotations

import numpy as np

from surfsup.viewing.camera import FIELD_OF_VIEW, Camera
from surfsup.viewing.graphics import require_graphics
from surfsup.viewing.pixel_box import PixelBox

_BACKGROUND = 0.9999999  # depth buffer values from here on are empty
_UP = np.array([0.0, 0.0, 1.0])


class Rasterizer:
    """An off-screen window that draws one triangle mesh at a time.

    VTK is used without pyvista's plotter, whose import takes seconds, and which draws a background of its own.

    Raises:
        InputError: this machine cannot render off screen.
    """

    def __init__(self) -> None:
        require_graphics()
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (registers the window for this machine)
        from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow

        self._window, self._renderer = vtkRenderWindow(), vtkRenderer()
        self._window.SetOffScreenRendering(True)
        self._window.SetMultiSamples(0)  # antialiasing would average depth and normals of two surfaces in a pixel
        self._window.AddRenderer(self._renderer)
        self._renderer.SetBackground(0, 0, 0)
        self._camera = self._renderer.GetActiveCamera()
        self._mapper, self._actor = vtkPolyDataMapper(), vtkActor()
        self._mapper.SetScalarModeToUsePointData()
        self._mapper.SetColorModeToDirectScalars()
        self._actor.SetMapper(self._mapper)
        self._actor.GetProperty().SetLighting(False)
        self._renderer.AddActor(self._actor)

    def set_perspective(self, camera: Camera, box: PixelBox, supersampling: int, near: float, far: float) -> None:
        """Draw the ``box`` of the picture of ``camera`` from now on.

        Args:
            camera: of the picture.
            box: its part to draw.
            supersampling: drawn pixels per pixel of the picture, along each axis.
            near, far: clipping planes, meters.
        """
        self._resize(box.size[0] * supersampling, box.size[1] * supersampling)
        # The frustum of the box is a part of the picture's: narrower, and off its axis.
        width, height = box.size
        share = height / camera.size[1]
        self._camera.SetParallelProjection(False)
        self._camera.SetViewAngle(2 * np.degrees(np.arctan(np.tan(np.radians(FIELD_OF_VIEW) / 2) * share)))
        self._camera.SetWindowCenter(
            (box.left + box.right - camera.size[0]) / width, (camera.size[1] - box.top - box.bottom) / height
        )
        self._aim(camera.eye, camera.target, near, far, _UP)

    def set_orthographic(
        self, direction: np.ndarray, target: np.ndarray, half_height: float, size: tuple[int, int]
    ) -> np.ndarray:
        """Use a parallel projection.

        Args:
            direction: (3,) of view.
            target: point (3,) in the center, meters.
            half_height: extent of the view above and below the target, meters.
            size: (width, height) in pixels.

        Returns:
            The rows right, up and forward (3, 3) of the view.
        """
        self._resize(*size)
        direction = direction / np.linalg.norm(direction)
        eye = target - 2 * half_height * direction
        self._camera.SetParallelProjection(True)
        self._camera.SetParallelScale(half_height)
        self._camera.SetWindowCenter(0, 0)
        up = np.array([0.0, 1.0, 0.0]) if abs(direction[2]) > 0.9 else _UP
        self._aim(eye, target, 0.01 * half_height, 4 * half_height, up)
        right = np.cross(direction, up)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, direction), direction])

    def _resize(self, width: int, height: int) -> None:
        self._size = width, height
        self._window.SetSize(width, height)

    def _aim(self, eye: np.ndarray, target: np.ndarray, near: float, far: float, up: np.ndarray) -> None:
        self._camera.SetPosition(*eye)
        self._camera.SetFocalPoint(*target)
        self._camera.SetViewUp(*up)
        self._camera.SetClippingRange(near, far)
        self._range = (near, far)

    def set_mesh(self, vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray | None = None) -> None:
        """Draw triangles from now on, unlit.

        Args:
            vertices: (V, 3), meters.
            faces: (F, 3).
            colors: (V, 3) uint8 of the vertices; black without.
        """
        from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
        from vtkmodules.vtkCommonCore import vtkPoints
        from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

        points, cells, mesh = vtkPoints(), vtkCellArray(), vtkPolyData()
        points.SetData(numpy_to_vtk(np.ascontiguousarray(vertices), deep=True))
        cells.SetData(3, numpy_to_vtkIdTypeArray(np.ascontiguousarray(faces, np.int64).ravel(), deep=True))
        mesh.SetPoints(points)
        mesh.SetPolys(cells)
        if colors is None:
            colors = np.zeros((len(vertices), 3), np.uint8)
        mesh.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(colors), deep=True))
        self._mapper.SetInputData(mesh)

    def render_depth(self) -> np.ndarray:
        """Draw, and return the depth (height, width) float32 in meters; infinite where nothing was drawn."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkFloatArray

        self._camera.SetClippingRange(*self._range)
        self._window.Render()
        width, height = self._size
        buffer = vtkFloatArray()
        self._window.GetZbufferData(0, 0, width - 1, height - 1, buffer)
        z = vtk_to_numpy(buffer).reshape(height, width)[::-1]
        near, far = (np.float32(plane) for plane in self._range)
        if self._camera.GetParallelProjection():
            meters = near + z * (far - near)
        else:
            meters = near * far / (far - z * (far - near))
        return np.where(z < _BACKGROUND, meters, np.float32(np.inf))

    def color(self) -> np.ndarray:
        """The colors (height, width, 3) uint8 of the last ``render_depth``."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        width, height = self._size
        buffer = vtkUnsignedCharArray()
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, buffer, 0)
        return vtk_to_numpy(buffer).reshape(height, width, 3)[::-1].copy()

    def close(self) -> None:
        """Free the window; nothing can be drawn afterwards."""
        self._window.Finalize()
