"""A solid and its light: colors of its vertices, and its shadow on the floor. They do not depend on the camera."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.ndimage import map_coordinates

from surfsup.viewing import lighting
from surfsup.viewing.rasterizer import Rasterizer
from surfsup.viewing.shading_mesh import ShadingMesh
from surfsup.viewing.shadow_maps import FULL_LIGHT, Light, ShadowMaps

FLOOR_REACH = 1.4  # meters from the center; solids of the usual size cast no shadow beyond it
_FLOOR_MARGIN = 0.4  # meters around a larger solid
_SOLID_ALBEDO = np.array([0.74, 0.38, 0.21], np.float32)  # warm and matte, as a contrast to water
_OPEN_SKY = np.float32(1.18)  # irradiance of the floor without any shadow


class LitSolid:
    """A solid with soft shadows on itself and on the floor.

    Attributes:
        mesh: its triangles; None without a solid.
        colors: (V, 3) uint8 of its vertices, encoded by :func:`surfsup.viewing.lighting.tone_map`.
        reach: meters from the floor's center along x and y; no shadow is beyond.
    """

    def __init__(self, solid: trimesh.Trimesh | None, rasterizer: Rasterizer, light: Light = FULL_LIGHT) -> None:
        self.reach = FLOOR_REACH
        self._floor = np.full((3, 2, 2), _OPEN_SKY)
        self.mesh, self.colors = None, np.empty((0, 3), np.uint8)
        if solid is None:
            return
        self.mesh = ShadingMesh.of(solid)
        shadows = ShadowMaps(self.mesh, light, rasterizer)
        self.colors = lighting.tone_map(_SOLID_ALBEDO * shadows.irradiance(self.mesh.vertices, self.mesh.normals))
        self.reach = max(FLOOR_REACH, shadows.reach + _FLOOR_MARGIN)
        line, zeros = np.linspace(-self.reach, self.reach, light.floor_cells, dtype=np.float32), np.float32(0)
        points = np.stack(np.broadcast_arrays(line[:, None], line, zeros), -1).reshape(-1, 3)
        up = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), points.shape)
        irradiance = shadows.irradiance(points, up).T.reshape(3, light.floor_cells, light.floor_cells)
        # The corner sees the whole sky; this keeps the floor's brightness independent of the solid.
        self._floor = irradiance / irradiance[:, :1, :1] * _OPEN_SKY

    def floor_irradiance(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Light (3, N) on the floor at ``x`` and ``y`` (N,), meters."""
        cells = np.stack([x, y])
        cells = (cells + self.reach) * ((self._floor.shape[1] - 1) / (2 * self.reach))
        return np.stack([map_coordinates(channel, cells, np.float32, 1, "nearest") for channel in self._floor])
