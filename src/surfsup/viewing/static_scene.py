"""The static part of a scene: solid, floor and backdrop. It is lit once with soft shadows; frames only add the water.

The solid is drawn as seen from many directions of the sky and the sun (shadow mapping, L. Williams, "Casting curved
shadows on curved surfaces", SIGGRAPH 1978). A point behind the drawn depth is in shadow for that direction.
Many directions give ambient occlusion and soft shadows. Irradiance is computed at the solid's vertices and on a grid on
the floor, not per pixel.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import trimesh
from scipy.ndimage import map_coordinates

from surfsup.viewing import lighting
from surfsup.viewing.camera import Camera
from surfsup.viewing.rasterizer import Rasterizer, triangle_mesh

if TYPE_CHECKING:
    import pyvista

_SOLID_ALBEDO = np.array([0.74, 0.38, 0.21], np.float32)  # warm and matte, as a contrast to water
_BACKDROP_TOP = np.array([0.70, 0.79, 0.88], np.float32)
_SKY_SHARE = 0.55
_SUN_SHARE = 0.72
_BOUNCE_SHARE = 0.30
_MAX_EDGE = 0.02  # meters; longer edges are split so that a shadow can end inside a triangle
_MAX_FACES = 400_000
_FLOOR_REACH = 1.4  # meters from the center; solids of the usual size cast no shadow beyond it
_FLOOR_MARGIN = 0.4  # meters around a larger solid
_FLOOR_CELLS = 320
_BIAS = 0.006  # meters; keeps a surface from shadowing itself
_OPEN_SKY = np.float32(1.18)  # irradiance of the floor without any shadow


@dataclass(frozen=True)
class Light:
    """How finely shadows are computed.

    Attributes:
        sky_samples, sun_samples: directions of light from the sky and from the sun.
        map_size: of a shadow map, pixels.
    """

    sky_samples: int
    sun_samples: int
    map_size: tuple[int, int]


FULL_LIGHT = Light(44, 12, (800, 800))
MOVING_LIGHT = Light(16, 8, (400, 400))  # of a frame among many, whose solids are elsewhere in the next


class StaticScene:
    """The picture without water, as ``camera`` sees it.

    Attributes:
        radiance: (H, W, 3) float32, linear color.
        depth: (H, W) float32, meters along the view, infinite in the backdrop.
    """

    def __init__(
        self, solid: trimesh.Trimesh | None, camera: Camera, rasterizer: Rasterizer, light: Light = FULL_LIGHT
    ) -> None:
        if solid is None:
            self.radiance, self.depth = _render_floor(camera, None)
            return
        mesh = _refine_mesh(solid)
        shadows = _ShadowMaps(mesh, light)
        self.radiance, self.depth = _render_floor(camera, shadows)
        normals = np.asarray(mesh.point_data["Normals"])
        colors = lighting.tone_map(_SOLID_ALBEDO * shadows.irradiance(np.asarray(mesh.points), normals))
        rasterizer.set_perspective(camera, *clipping_range(camera))
        rasterizer.set_mesh(mesh, colors)
        depth = rasterizer.render_depth()
        visible = depth < self.depth
        self.radiance[visible] = lighting.LINEAR_FROM_BYTE[rasterizer.color()[visible]]
        self.depth[visible] = depth[visible]


def clipping_range(camera: Camera) -> tuple[float, float]:
    """The near and the far clipping plane, meters: a few meters around the target."""
    distance = float(np.linalg.norm(camera.target - camera.eye))
    return 0.1 * distance, 2.5 * distance


def _refine_mesh(solid: trimesh.Trimesh) -> "pyvista.PolyData":
    """The solid with short edges, and with normals that are smooth except at sharp edges."""
    vertices, faces = np.asarray(solid.vertices), np.asarray(solid.faces)
    max_edge = max(_MAX_EDGE, float(np.sqrt(solid.area / _MAX_FACES * 4)))
    vertices, faces = trimesh.remesh.subdivide_to_size(vertices, faces, max_edge, max_iter=12)
    # subdivide_to_size gives every triangle its own vertices; merged vertices share a normal.
    merged = trimesh.Trimesh(vertices, faces, process=True)
    return triangle_mesh(np.asarray(merged.vertices, np.float32), merged.faces).compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=40.0,
        consistent_normals=False,
        auto_orient_normals=False,
    )


class _ShadowMaps:
    """Shadow maps of one solid, one for each direction of light."""

    def __init__(self, mesh: "pyvista.PolyData", light: Light) -> None:
        rasterizer = Rasterizer(light.map_size)
        low, high = np.array(mesh.bounds)[0::2], np.array(mesh.bounds)[1::2]
        center, half = (low + high) / 2, float(np.linalg.norm(high - low)) / 2 * 1.02
        rasterizer.set_mesh(mesh)
        sky, sun = lighting.sky_directions(light.sky_samples), lighting.sun_directions(light.sun_samples)
        colors = [
            *(lighting.sky_radiance(sky) * (2.0 * _SKY_SHARE / light.sky_samples)),
            *np.tile(lighting.SUN_COLOR * (_SUN_SHARE / light.sun_samples), (light.sun_samples, 1)),
        ]
        self._maps = []
        for direction, color in zip(np.concatenate([sky, sun]).astype(np.float32), colors, strict=True):
            axes = rasterizer.set_orthographic(-direction, center, half).astype(np.float32)
            self._maps.append((direction, axes, rasterizer.render_depth(), color))
        rasterizer.close()
        self._center, self._half = center.astype(np.float32), np.float32(half)

    @property
    def floor_reach(self) -> float:
        """Largest distance of a shadow from the floor's center along x or y, meters."""
        return max(_FLOOR_REACH, float(np.abs(self._center[:2]).max() + self._half) + _FLOOR_MARGIN)

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


def _render_floor(camera: Camera, shadows: _ShadowMaps | None) -> tuple[np.ndarray, np.ndarray]:
    """Radiance and depth of the floor at z = 0, which fades into the backdrop."""
    rays = camera.rays()
    height, width = rays.shape[:2]
    with np.errstate(divide="ignore"):
        depth = np.where(rays[..., 2] < -1e-4, -camera.eye[2] / rays[..., 2], np.inf).astype(np.float32)
    finite_depth = np.where(np.isfinite(depth), depth, 0.0)
    x, y = camera.eye[0] + finite_depth * rays[..., 0], camera.eye[1] + finite_depth * rays[..., 1]

    reach = _FLOOR_REACH if shadows is None else shadows.floor_reach
    grid = np.linspace(-reach, reach, _FLOOR_CELLS, dtype=np.float32)
    points = np.stack([*np.meshgrid(grid, grid, indexing="ij"), np.zeros((_FLOOR_CELLS,) * 2, np.float32)], -1)
    if shadows is None:
        irradiance = np.full((*points.shape[:2], 3), _OPEN_SKY)
    else:
        normals = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), points.shape)
        irradiance = shadows.irradiance(points.reshape(-1, 3), normals.reshape(-1, 3)).reshape(points.shape)
        # The corner sees the whole sky; this keeps the floor's brightness independent of the solid.
        irradiance = irradiance / irradiance[0, 0] * _OPEN_SKY
    cells_per_meter = (_FLOOR_CELLS - 1) / (2 * reach)
    cells = [(x + reach) * cells_per_meter, (y + reach) * cells_per_meter]
    floor = np.stack([map_coordinates(irradiance[..., c], cells, order=1, mode="nearest") for c in range(3)], -1)

    backdrop = lighting.SKY_HORIZON + np.linspace(0.9, 0.0, height, dtype=np.float32)[:, None, None] * (
        _BACKDROP_TOP - lighting.SKY_HORIZON
    )
    backdrop = np.broadcast_to(backdrop, (height, width, 3))
    fade = np.clip((np.hypot(x, y) * (_FLOOR_REACH / reach) - 0.75) / 1.7, 0.0, 1.0)
    fade = np.where(np.isfinite(depth), fade * fade * (3 - 2 * fade), 1.0)[..., None].astype(np.float32)
    return (floor * lighting.FLOOR_ALBEDO * (1 - fade) + backdrop * fade).astype(np.float32), depth
