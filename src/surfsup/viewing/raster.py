"""Triangles to pixels: VTK draws color and depth off screen and nothing else; light is computed from these
in NumPy.
"""

from typing import TYPE_CHECKING

import numpy as np

from surfsup.viewing.camera import FIELD_OF_VIEW, Camera
from surfsup.viewing.graphics import require_graphics

if TYPE_CHECKING:
    import pyvista

_BACKGROUND = 0.9999999  # depth buffer values from here on are empty


class Rasterizer:
    """An off-screen window of `size` (width, height) pixels that draws one triangle mesh at a time.

    Raises InputError where this machine cannot draw off screen.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        require_graphics()
        import pyvista

        self._plotter = pyvista.Plotter(off_screen=True, window_size=list(size), lighting="none")
        self._window = self._plotter.render_window
        self._window.SetMultiSamples(0)  # depth and normals of two surfaces must not be averaged in a pixel
        self._size = size

    def perspective(self, camera: Camera, near: float, far: float) -> None:
        """Look through `camera`; nothing nearer than `near` or farther than `far` (meters) is drawn."""
        vtk_camera = self._plotter.camera
        vtk_camera.SetParallelProjection(False)
        vtk_camera.SetViewAngle(FIELD_OF_VIEW)
        self._aim(camera.eye, camera.target, near, far)

    def parallel(self, direction: np.ndarray, target: np.ndarray, half_height: float) -> np.ndarray:
        """Look along `direction` (3,) at `target` (3,), in parallel, at `half_height` meters above and below
        it.

        Returns the rows right, up and forward (3, 3) of that view.
        """
        direction = direction / np.linalg.norm(direction)
        eye = target - 2 * half_height * direction
        self._plotter.camera.SetParallelProjection(True)
        self._plotter.camera.SetParallelScale(half_height)
        aside = np.array([0.0, 1.0, 0.0]) if abs(direction[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
        self._aim(eye, target, 0.01 * half_height, 4 * half_height, aside)
        right = np.cross(direction, aside)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, direction), direction])

    def _aim(self, eye: np.ndarray, target: np.ndarray, near: float, far: float, up: np.ndarray | None = None) -> None:
        camera = self._plotter.camera
        camera.SetPosition(*eye)
        camera.SetFocalPoint(*target)
        camera.SetViewUp(*(up if up is not None else (0.0, 0.0, 1.0)))
        camera.SetClippingRange(near, far)
        self._range = (near, far)

    def hold(self, mesh: "pyvista.PolyData", colors: np.ndarray | None = None) -> None:
        """Draw `mesh` from now on, in vertex `colors` (N, 3) uint8, as they are: without light."""
        self._plotter.clear_actors()
        if mesh.n_points:
            mesh.point_data["colors"] = colors if colors is not None else np.zeros((mesh.n_points, 3), np.uint8)
            self._plotter.add_mesh(
                mesh,
                scalars="colors",
                rgb=True,
                lighting=False,
                copy_mesh=False,
                reset_camera=False,
                render=False,
                show_scalar_bar=False,
            )

    def depth(self) -> np.ndarray:
        """Distance along the view (height, width) float32 in meters; infinite where nothing is."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkFloatArray

        self._draw()
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
        """The colors (height, width, 3) uint8 of what was drawn by the last call of `depth`."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        width, height = self._size
        buffer = vtkUnsignedCharArray()
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, buffer, 0)
        return vtk_to_numpy(buffer).reshape(height, width, 3)[::-1].copy()

    def _draw(self) -> None:
        self._plotter.camera.SetClippingRange(*self._range)  # adding a mesh moves it
        self._window.Render()

    def close(self) -> None:
        """Free the window; nothing can be drawn afterwards."""
        self._plotter.close()
