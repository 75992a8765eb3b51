"""Shadow maps of a solid (L. Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978).

The solid is drawn as seen from many directions of the sky and the sun. A point behind the drawn depth is in shadow for
that direction. Many directions give ambient occlusion and soft shadows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surfsup.viewing import lighting
from surfsup.viewing.rasterizer import Rasterizer
from surfsup.viewing.shading_mesh import ShadingMesh

_SKY_SHARE = 0.55
_SUN_SHARE = 0.72
_BOUNCE_SHARE = 0.30
_BIAS = 0.006  # meters; keeps a surface from shadowing itself


@dataclass(frozen=True)
class Light:
    """How finely shadows are computed.

    Attributes:
        sky_samples, sun_samples: directions of light from the sky and from the sun.
        map_size: of a shadow map, pixels.
        floor_cells: along a side of the grid of light on the floor.
    """

    sky_samples: int
    sun_samples: int
    map_size: tuple[int, int]
    floor_cells: int


FULL_LIGHT = Light(44, 12, (800, 800), 320)
MOVING_LIGHT = Light(16, 8, (400, 400), 200)  # of a frame among many, whose solids are elsewhere in the next


class ShadowMaps:
    """Shadow maps of one solid, one for each direction of light."""

    def __init__(self, mesh: ShadingMesh, light: Light, rasterizer: Rasterizer) -> None:
        low, high = mesh.vertices.min(0), mesh.vertices.max(0)
        center, half = (low + high) / 2, float(np.linalg.norm(high - low)) / 2 * 1.02
        rasterizer.set_mesh(mesh.vertices, mesh.faces)
        sky, sun = lighting.sky_directions(light.sky_samples), lighting.sun_directions(light.sun_samples)
        colors = [
            *(lighting.sky_radiance(sky) * (2.0 * _SKY_SHARE / light.sky_samples)),
            *np.tile(lighting.SUN_COLOR * (_SUN_SHARE / light.sun_samples), (light.sun_samples, 1)),
        ]
        self._maps = []
        for direction, color in zip(np.concatenate([sky, sun]).astype(np.float32), colors, strict=True):
            axes = rasterizer.set_orthographic(-direction, center, half, light.map_size).astype(np.float32)
            self._maps.append((direction, axes, rasterizer.render_depth(), color))
        self._center, self._half = center.astype(np.float32), np.float32(half)

    @property
    def reach(self) -> float:
        """Largest distance of the solid from the floor's center along x or y, meters, at most."""
        return float(np.abs(self._center[:2]).max() + self._half)

    def irradiance(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Light (N, 3) on a white surface at ``points`` (N, 3) with unit ``normals`` (N, 3)."""
        points = points.astype(np.float32) + np.float32(_BIAS) * normals.astype(np.float32)
        normals = normals.astype(np.float32)
        # Light from the floor reaches surfaces that face down; less close to the floor, where the solid shadows it.
        bounce = (0.5 - 0.5 * normals[:, 2:]) * (0.35 + 0.65 * np.clip(points[:, 2:] / 0.4, 0.0, 1.0))
        total = (_BOUNCE_SHARE * bounce * lighting.FLOOR_ALBEDO).astype(np.float32)
        for direction, axes, depth, color in self._maps:
            cosine = normals @ direction
            facing = np.flatnonzero(cosine > 0)
            lit = facing[self._visible(points[facing], axes, depth)]
            total[lit] += cosine[lit, None] * color
        return total

    def _visible(self, points: np.ndarray, axes: np.ndarray, depth: np.ndarray) -> np.ndarray:
        height, width = depth.shape
        local = (points - self._center) @ axes.T
        scale = np.float32(height / 2) / self._half
        x = (local[:, 0] * scale + width / 2).astype(np.int32)
        y = (height / 2 - local[:, 1] * scale).astype(np.int32)
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        nearest = depth[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)]
        return ~inside | (local[:, 2] + 2 * self._half < nearest + np.float32(_BIAS))
