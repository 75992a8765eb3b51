"""What depends on the camera alone: rays through the pixels, the floor's depth, and how the floor fades to a backdrop.

Arrays of vectors have their components first, (3, height, width): NumPy is several times as fast that way.
"""

from __future__ import annotations

import numpy as np

from surfsup.viewing import lighting
from surfsup.viewing.camera import Camera
from surfsup.viewing.lit_solid import FLOOR_REACH, LitSolid

SUPERSAMPLING = 2  # samples per pixel of the picture, along each axis
_BACKDROP_TOP = np.array([0.70, 0.79, 0.88], np.float32)


def coarse_mean(fine: np.ndarray) -> np.ndarray:
    """The mean (..., H, W) of the samples (..., 2 H, 2 W) in each pixel."""
    return 0.25 * (fine[..., ::2, ::2] + fine[..., 1::2, ::2] + fine[..., ::2, 1::2] + fine[..., 1::2, 1::2])


def repeated(coarse: np.ndarray) -> np.ndarray:
    """The samples (..., 2 H, 2 W) with the value (..., H, W) of their pixel."""
    return coarse.repeat(SUPERSAMPLING, -2).repeat(SUPERSAMPLING, -1)


class Viewpoint:
    """A camera and its view of the floor.

    Attributes:
        camera: of the picture.
        rays: (3, H, W), of depth one, see :meth:`Camera.rays`.
        views: (3, H, W), unit, towards the camera.
        floor_depth: (2 H, 2 W) of the samples, meters, infinite above the horizon.
    """

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self.rays = np.ascontiguousarray(np.moveaxis(camera.rays(), -1, 0))
        self.views = -self.rays / np.sqrt((self.rays**2).sum(0))
        self.floor_depth = _floor_depth(camera, camera.rays(SUPERSAMPLING)[..., 2])
        depth = _floor_depth(camera, self.rays[2])
        self._on_floor = np.isfinite(depth)
        depth = np.where(self._on_floor, depth, 0)
        self._x, self._y = (np.float32(camera.eye[axis]) + depth * self.rays[axis] for axis in (0, 1))
        self._distance = np.hypot(self._x, self._y)
        height = camera.size[1]
        blend = np.linspace(0.9, 0.0, height, dtype=np.float32) * np.ones((3, 1), np.float32)
        self._backdrop = lighting.SKY_HORIZON[:, None] + blend * (_BACKDROP_TOP - lighting.SKY_HORIZON)[:, None]

    def floor_radiance(self, solid: LitSolid) -> np.ndarray:
        """Color (3, H, W) of the floor at z = 0 with the shadow of ``solid``, fading into the backdrop."""
        fade = np.clip((self._distance * (FLOOR_REACH / solid.reach) - 0.75) / 1.7, 0.0, 1.0)
        fade = np.where(self._on_floor, fade * fade * (3 - 2 * fade), np.float32(1))
        radiance = fade * self._backdrop[:, :, None]
        seen = fade < 1
        floor = solid.floor_irradiance(self._x[seen], self._y[seen]) * lighting.FLOOR_ALBEDO[:, None]
        radiance[:, seen] += floor * (1 - fade[seen])
        return radiance


def _floor_depth(camera: Camera, ray_height: np.ndarray) -> np.ndarray:
    """Depth of the floor along rays with vertical components ``ray_height``; infinite for those that go up."""
    with np.errstate(divide="ignore"):
        return np.where(ray_height < -1e-4, np.float32(-camera.eye[2]) / ray_height, np.float32(np.inf))
