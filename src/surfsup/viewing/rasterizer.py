"""Off-screen rasterization of triangles with VTK: color and depth only. Lighting is computed in NumPy."""

from typing import TYPE_CHECKING

import numpy as np

from surfsup.viewing.camera import FIELD_OF_VIEW, Camera
from surfsup.viewing.graphics import require_graphics

if TYPE_CHECKING:
    import pyvista

_BACKGROUND = 0.9999999  # depth buffer values from here on are empty
_UP = np.array([0.0, 0.0, 1.0])


class Rasterizer:
    """An off-screen window of ``size`` (width, height) pixels that draws one triangle mesh at a time.

    Raises:
        InputError: this machine cannot render off screen.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        require_graphics()
        import pyvista

        self._plotter = pyvista.Plotter(off_screen=True, window_size=list(size), lighting="none")
        window = self._plotter.render_window
        assert window is not None
        window.SetMultiSamples(0)  # antialiasing would average depth and normals of two surfaces in a pixel
        self._window = window
        self._size = size

    def set_perspective(self, camera: Camera, near: float, far: float) -> None:
        """Use the perspective of ``camera`` with the clipping planes ``near`` and ``far``, meters."""
        vtk_camera = self._plotter.camera
        vtk_camera.SetParallelProjection(False)
        vtk_camera.SetViewAngle(FIELD_OF_VIEW)
        self._aim(camera.eye, camera.target, near, far, _UP)

    def set_orthographic(self, direction: np.ndarray, target: np.ndarray, half_height: float) -> np.ndarray:
        """Use a parallel projection.

        Args:
            direction: (3,) of view.
            target: point (3,) in the center, meters.
            half_height: extent of the view above and below the target, meters.

        Returns:
            The rows right, up and forward (3, 3) of the view.
        """
        direction = direction / np.linalg.norm(direction)
        eye = target - 2 * half_height * direction
        self._plotter.camera.SetParallelProjection(True)
        self._plotter.camera.SetParallelScale(half_height)
        up = np.array([0.0, 1.0, 0.0]) if abs(direction[2]) > 0.9 else _UP
        self._aim(eye, target, 0.01 * half_height, 4 * half_height, up)
        right = np.cross(direction, up)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, direction), direction])

    def _aim(self, eye: np.ndarray, target: np.ndarray, near: float, far: float, up: np.ndarray) -> None:
        camera = self._plotter.camera
        camera.SetPosition(*eye)
        camera.SetFocalPoint(*target)
        camera.SetViewUp(*up)
        camera.SetClippingRange(near, far)
        self._range = (near, far)

    def set_mesh(self, mesh: "pyvista.PolyData", colors: np.ndarray | None = None) -> None:
        """Draw ``mesh`` from now on, unlit, in vertex ``colors`` (N, 3) uint8; black without colors."""
        self._plotter.clear_actors()
        if mesh.n_points:
            mesh.point_data["colors"] = colors if colors is not None else np.zeros((mesh.n_points, 3), np.uint8)
            self._plotter.add_mesh(
                mesh, scalars="colors", rgb=True, lighting=False,
                copy_mesh=False, reset_camera=False, render=False, show_scalar_bar=False,
            )  # fmt: skip

    def render_depth(self) -> np.ndarray:
        """Draw, and return the depth (height, width) float32 in meters; infinite where nothing was drawn."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkFloatArray

        self._plotter.camera.SetClippingRange(*self._range)  # adding a mesh changes it
        self._window.Render()
        width, height = self._size
        buffer = vtkFloatArray()
        self._window.GetZbufferData(0, 0, width - 1, height - 1, buffer)
        z = vtk_to_numpy(buffer).reshape(height, width)[::-1]
        near, far = self._range
        if self._plotter.camera.GetParallelProjection():
            meters = near + z * (far - near)
        else:
            meters = near * far / (far - z * (far - near))
        return np.where(z < _BACKGROUND, meters, np.float32(np.inf)).astype(np.float32)

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
        self._plotter.close()


def triangle_mesh(vertices: np.ndarray, faces: np.ndarray) -> "pyvista.PolyData":
    """A VTK mesh of ``vertices`` (V, 3), kept in their precision, and triangles ``faces`` (F, 3)."""
    import pyvista

    # VTK misreads unsigned indices.
    indices: np.ndarray = np.asarray(faces, np.int64)
    return pyvista.PolyData.from_regular_faces(vertices, indices)
