"""What stands still: solid, floor and backdrop, lit once with soft shadows, so that a frame only has to add
the water.

Light is gathered the direct way: from every direction of the sky and the sun the solid is drawn once as seen
from there, and a point that is farther away than what was drawn lies in shadow (shadow mapping, Williams
1978; many lights give the soft look of ambient occlusion). It is gathered at the solid's vertices and on a
grid on the floor, not at pixels.
"""

from typing import TYPE_CHECKING

import numpy as np
import trimesh
from scipy.ndimage import map_coordinates

from surfsup.viewing import light
from surfsup.viewing.camera import Camera
from surfsup.viewing.raster import Rasterizer

if TYPE_CHECKING:
    import pyvista

SOLID = np.array([0.74, 0.38, 0.21], np.float32)  # warm and matte, for water is cool and shiny
_SKY_SAMPLES = 44
_SUN_SAMPLES = 12
_SKY_SHARE = 0.55
_SUN_SHARE = 0.72
_BOUNCE_SHARE = 0.30
_SHADOW_MAP = (800, 800)  # pixels
_EDGE = 0.02  # meters; triangles are split until their edges are shorter, so that a shadow may end inside one
_MOST_FACES = 400_000
_FLOOR_REACH = 1.4  # meters from the center, beyond which no shadow of a solid of the usual size falls
_FLOOR_MARGIN = 0.4  # meters around a larger one
_FLOOR_CELLS = 320
_BIAS = 0.006  # meters; a surface must not shade itself


class Stage:
    """The picture without water, as `camera` sees it.

    light: (H, W, 3) float32, linear color.
    depth: (H, W) float32, meters along the view, infinite in the backdrop.
    """

    def __init__(self, solid: trimesh.Trimesh | None, camera: Camera, raster: Rasterizer) -> None:
        mesh = _fine_mesh(solid) if solid is not None else None
        shadows = _Shadows(mesh) if mesh is not None else None
        self.light, self.depth = _floor(camera, shadows)
        if mesh is None:
            return
        normals = np.asarray(mesh.point_data["Normals"])
        colors = light.to_display(SOLID * shadows.irradiance(np.asarray(mesh.points), normals))
        raster.perspective(camera, *view_range(camera))
        raster.hold(mesh, colors)
        depth = raster.depth()
        seen = depth < self.depth
        self.light[seen] = light.FROM_DISPLAY[raster.color()[seen]]
        self.depth[seen] = depth[seen]


def view_range(camera: Camera) -> tuple[float, float]:
    """Nearest and farthest distance (meters) worth drawing: everything within a few meters of what is
    looked at.
    """
    distance = float(np.linalg.norm(camera.target - camera.eye))
    return 0.1 * distance, 2.5 * distance


def _fine_mesh(solid: trimesh.Trimesh) -> "pyvista.PolyData":
    """The solid with short edges, and with normals that are smooth except over sharp edges."""
    import pyvista

    vertices, faces = np.asarray(solid.vertices), np.asarray(solid.faces)
    edge = max(_EDGE, float(np.sqrt(solid.area / _MOST_FACES * 4)))
    vertices, faces = trimesh.remesh.subdivide_to_size(vertices, faces, edge, max_iter=12)
    # subdivide_to_size leaves every triangle its own corners: only merged ones can share a normal
    merged = trimesh.Trimesh(vertices, faces, process=True)
    mesh = pyvista.PolyData.from_regular_faces(
        np.asarray(merged.vertices, np.float32), np.asarray(merged.faces, np.int64)
    )
    return mesh.compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=40.0,
        consistent_normals=False,
        auto_orient_normals=False,
    )


class _Shadows:
    """How much light reaches a point past one solid."""

    def __init__(self, mesh: "pyvista.PolyData") -> None:
        raster = Rasterizer(_SHADOW_MAP)
        low, high = np.array(mesh.bounds)[0::2], np.array(mesh.bounds)[1::2]
        center, half = (low + high) / 2, float(np.linalg.norm(high - low)) / 2 * 1.02
        raster.hold(mesh)
        sky, sun = light.sky_directions(_SKY_SAMPLES), light.sun_directions(_SUN_SAMPLES)
        colors = [
            *(light.sky_dome(sky) * (2.0 * _SKY_SHARE / _SKY_SAMPLES)),
            *np.tile(light.SUN_COLOR * (_SUN_SHARE / _SUN_SAMPLES), (_SUN_SAMPLES, 1)),
        ]
        self._maps = []
        for direction, color in zip(np.concatenate([sky, sun]).astype(np.float32), colors, strict=True):
            axes = raster.parallel(-direction, center, half).astype(np.float32)
            self._maps.append((direction, axes, raster.depth(), color))
        raster.close()
        self._center, self._half = center.astype(np.float32), np.float32(half)

    @property
    def reach(self) -> float:
        """How far from the center of the floor its shadows may fall, meters."""
        return max(_FLOOR_REACH, float(np.abs(self._center[:2]).max() + self._half) + _FLOOR_MARGIN)

    def irradiance(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Light (N, 3) on a white surface at `points` (N, 3) with unit `normals` (N, 3)."""
        points = points.astype(np.float32) + np.float32(_BIAS) * normals.astype(np.float32)
        normals = normals.astype(np.float32)
        # The floor's bounce lights what faces down, less so close to the floor, where it lies in
        # the solid's own shadow.
        bounce = (0.5 - 0.5 * normals[:, 2:]) * (0.35 + 0.65 * np.clip(points[:, 2:] / 0.4, 0.0, 1.0))
        total = (_BOUNCE_SHARE * bounce * light.GROUND).astype(np.float32)
        for direction, axes, depth, color in self._maps:
            facing = normals @ direction
            turned = np.flatnonzero(facing > 0)
            lit = turned[self._visible(points[turned], axes, depth)]
            total[lit] += facing[lit, None] * color
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


def _floor(camera: Camera, shadows: _Shadows | None) -> tuple[np.ndarray, np.ndarray]:
    """Light and depth of the floor at z = 0, which fades into the backdrop far away."""
    rays = camera.rays()
    height, width = rays.shape[:2]
    with np.errstate(divide="ignore"):
        depth = np.where(rays[..., 2] < -1e-4, -camera.eye[2] / rays[..., 2], np.inf).astype(np.float32)
    reach = np.where(np.isfinite(depth), depth, 0.0)
    x, y = camera.eye[0] + reach * rays[..., 0], camera.eye[1] + reach * rays[..., 1]

    wide = _FLOOR_REACH if shadows is None else shadows.reach
    grid = np.linspace(-wide, wide, _FLOOR_CELLS, dtype=np.float32)
    points = np.stack([*np.meshgrid(grid, grid, indexing="ij"), np.zeros((_FLOOR_CELLS,) * 2, np.float32)], -1)
    upwards = np.broadcast_to(np.array([0.0, 0.0, 1.0], np.float32), points.shape)
    open_sky = np.float32(1.18)
    if shadows is None:
        lit = np.full((*points.shape[:2], 3), open_sky)
    else:
        lit = shadows.irradiance(points.reshape(-1, 3), upwards.reshape(-1, 3)).reshape(points.shape)
        lit = (
            lit / lit[0, 0] * open_sky
        )  # a corner sees the whole sky; the floor's own white must not depend on the solid
    to_cells = (_FLOOR_CELLS - 1) / (2 * wide)
    where = [(x + wide) * to_cells, (y + wide) * to_cells]
    floor = np.stack([map_coordinates(lit[..., c], where, order=1, mode="nearest") for c in range(3)], -1)

    backdrop = light.SKY_HORIZON + np.linspace(0.9, 0.0, height, dtype=np.float32)[:, None, None] * (
        np.array([0.70, 0.79, 0.88], np.float32) - light.SKY_HORIZON
    )
    backdrop = np.broadcast_to(backdrop, (height, width, 3))
    far = np.clip((np.hypot(x, y) * (_FLOOR_REACH / wide) - 0.75) / 1.7, 0.0, 1.0)
    far = np.where(np.isfinite(depth), far * far * (3 - 2 * far), 1.0)[..., None].astype(np.float32)
    return (floor * light.GROUND * (1 - far) + backdrop * far).astype(np.float32), depth
