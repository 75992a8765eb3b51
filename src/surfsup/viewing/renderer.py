"""Pictures of a scene's frames: the static scene is rendered once, then each frame adds its water."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from surfsup.viewing import lighting
from surfsup.viewing.camera import Camera, fit_camera, picture_scale
from surfsup.viewing.rasterizer import Rasterizer
from surfsup.viewing.static_scene import StaticScene, clipping_range
from surfsup.viewing.water import light_space_axes, reconstruct_surface, shade_water, water_shadow, water_thickness

if TYPE_CHECKING:
    import pyvista

_SUPERSAMPLING = 2  # rendered pixels per pixel of the picture, along each axis
_EDGE_COLOR = np.array([0.30, 0.36, 0.42], np.float32)
_EDGE_OPACITY = 0.55


class FrameRenderer:
    """Renders the frames of one scene with fixed light and camera.

    Args:
        solid: the mesh of the solid, meters, or None.
        container_size: (x, y, z), meters; x and y are centered on 0, the floor is at z = 0.
        particle_radius: half the particle spacing, meters.
        focus: points (N, 3) to show beside solid and floor, for instance the particles of frame 0; or None.
        size: (width, height) of the picture in pixels.

    Raises:
        InputError: this machine cannot render off screen; the message names the missing packages.
    """

    def __init__(
        self,
        solid: trimesh.Trimesh | None,
        container_size: tuple[float, float, float],
        particle_radius: float,
        focus: np.ndarray | None = None,
        size: tuple[int, int] = (960, 720),
    ) -> None:
        self._scale = picture_scale(container_size, particle_radius)
        if self._scale != 1:
            x, y, z = container_size
            container_size = (self._scale * x, self._scale * y, self._scale * z)
            solid = solid.copy().apply_scale(self._scale) if solid is not None else None
            focus = self._scale * focus if focus is not None else None
        self._radius = self._scale * particle_radius
        render_size = (size[0] * _SUPERSAMPLING, size[1] * _SUPERSAMPLING)
        bounds = np.asarray(solid.bounds) if solid is not None else None
        self._camera = fit_camera(container_size, bounds, focus, render_size)
        self._rasterizer = Rasterizer(render_size)
        self._static = StaticScene(solid, self._camera, self._rasterizer)
        self._rays = self._camera.rays()
        self._edges = _container_edges(container_size, self._camera)
        # Water casts shadows on the solid and on the floor, up to the reach of a low sun. Shadows are soft, so one
        # point for each pixel of the picture is enough.
        depth = self._static.depth[::_SUPERSAMPLING, ::_SUPERSAMPLING]
        finite = np.isfinite(depth)
        rays = self._rays[::_SUPERSAMPLING, ::_SUPERSAMPLING]
        points = self._camera.eye.astype(np.float32) + np.where(finite, depth, 0.0)[..., None] * rays
        self._receives_shadow = finite & (np.abs(points[..., :2]).max(-1) < 2.0 * max(container_size))
        self._shadow_points = points[self._receives_shadow] @ light_space_axes().T
        self._rasterizer.set_perspective(self._camera, *clipping_range(self._camera))

    def render(self, positions: np.ndarray) -> np.ndarray:
        """The picture (height, width, 3) uint8 of particles at ``positions`` (N, 3), meters.

        Particles with a non-finite position are left out.
        """
        positions = np.asarray(positions, np.float32)
        positions = self._scale * positions[np.isfinite(positions).all(1)]
        picture, depth = self._static.radiance.copy(), self._static.depth
        light = np.ones(self._receives_shadow.shape, np.float32)
        light[self._receives_shadow] = water_shadow(positions, self._radius, self._shadow_points)
        picture *= light.repeat(_SUPERSAMPLING, 0).repeat(_SUPERSAMPLING, 1)[..., None]

        surface = reconstruct_surface(positions, self._radius)
        if surface.n_points:
            picture, depth = self._add_water(surface, positions, picture)
        self._edges.draw(picture, depth)
        width, height = self._camera.size
        shape = (height // _SUPERSAMPLING, _SUPERSAMPLING, width // _SUPERSAMPLING, _SUPERSAMPLING, 3)
        return lighting.tone_map(picture.reshape(shape).mean((1, 3)))

    def _add_water(
        self, surface: "pyvista.PolyData", positions: np.ndarray, background: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        # A vertex of only degenerate triangles has no normal; it covers no pixel, so any color will do.
        vertex_normals = np.nan_to_num(surface.point_data["Normals"])
        self._rasterizer.set_mesh(surface, (vertex_normals * 127.5 + 128.0).astype(np.uint8))
        depth = self._rasterizer.render_depth()
        rows, columns = np.nonzero(depth < self._static.depth)
        normals = self._rasterizer.color()[rows, columns].astype(np.float32) / 127.5 - 1.0
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        thickness = water_thickness(positions, self._radius, self._camera, self._static.depth)[rows, columns]
        picture = background.copy()
        picture[rows, columns] = shade_water(
            normals, self._rays[rows, columns], depth[rows, columns], thickness, rows, columns,
            background, self._static.depth, self._camera,
        )  # fmt: skip
        return picture, np.minimum(depth, self._static.depth)

    def close(self) -> None:
        """Free the off-screen window."""
        self._rasterizer.close()


@dataclass(frozen=True)
class _Edges:
    """The pixels (P,) on the container's edges, with their depth in meters and their opacity."""

    rows: np.ndarray
    columns: np.ndarray
    depth: np.ndarray
    opacity: np.ndarray

    def draw(self, picture: np.ndarray, depth: np.ndarray) -> None:
        """Blend the edges into ``picture`` (H, W, 3) where nothing of ``depth`` (H, W) is in front of them."""
        visible = self.depth < depth[self.rows, self.columns] + 0.01  # the floor's edges are in the floor
        rows, columns, opacity = self.rows[visible], self.columns[visible], self.opacity[visible, None]
        picture[rows, columns] += opacity * (_EDGE_COLOR - picture[rows, columns])


def _container_edges(container_size: tuple[float, float, float], camera: Camera) -> _Edges:
    """The pixels on the container's twelve edges."""
    x, y, z = container_size
    corners = np.array(
        [[sx * x / 2, sy * y / 2, h] for h in (0.0, z) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    pairs = [(i, (i + 1) % 4) for i in range(4)]
    pairs += [(a + 4, b + 4) for a, b in pairs] + [(i, i + 4) for i in range(4)]
    width, height = camera.size
    found = []
    for a, b in pairs:
        points = corners[a] + np.linspace(0, 1, 4 * max(width, height))[:, None] * (corners[b] - corners[a])
        pixels, depth = camera.project(points)
        opacity = _EDGE_OPACITY * np.clip(1.0 - 0.75 * points[:, 2] / z, 0.2, 1.0)  # fades upwards
        for offset in ((0, 0), (1, 0), (0, 1), (1, 1)):
            column, row = np.floor(pixels + offset - 0.5).astype(int).T
            visible = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            found.append(np.stack([row, column, depth, opacity], 1)[visible])
    rows, columns, depth, opacity = np.concatenate(found).T
    _, first = np.unique(rows.astype(int) * width + columns.astype(int), return_index=True)
    return _Edges(rows[first].astype(int), columns[first].astype(int), depth[first], opacity[first].astype(np.float32))
