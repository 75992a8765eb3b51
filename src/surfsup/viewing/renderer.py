"""Pictures of a scene's frames: the static scene is rendered once, then each frame adds its water."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import trimesh

from surfsup.viewing import lighting
from surfsup.viewing.camera import Camera, fit_camera, picture_scale
from surfsup.viewing.moving_mesh import container_corners
from surfsup.viewing.rasterizer import Rasterizer
from surfsup.viewing.static_scene import FULL_LIGHT, MOVING_LIGHT, Light, StaticScene, clipping_range
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
        bounds: corners (2, 3) of a box that solids which move stay in, meters, or None.
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
        bounds: np.ndarray | None = None,
    ) -> None:
        self._scale = picture_scale(container_size, particle_radius)
        x, y, z = (self._scale * side for side in container_size)
        self._radius, self._container_size = self._scale * particle_radius, (x, y, z)
        focus = None if focus is None else self._scale * focus
        render_size = (size[0] * _SUPERSAMPLING, size[1] * _SUPERSAMPLING)
        if bounds is None and solid is not None:
            bounds = np.asarray(solid.bounds)
        bounds = None if bounds is None else self._scale * bounds
        self._camera = fit_camera(self._container_size, bounds, focus, render_size)
        self._rasterizer = Rasterizer(render_size)
        self._rays, self._draws_edges = self._camera.rays(), True
        self.set_solid(solid, container_corners(container_size, {}, 0), FULL_LIGHT)

    def set_solid(self, solid: trimesh.Trimesh | None, corners: np.ndarray, light: Light = MOVING_LIGHT) -> None:
        """Draw ``solid`` and a container with ``corners`` (8, 3) in meters from now on."""
        if self._scale != 1 and solid is not None:
            solid = solid.copy().apply_scale(self._scale)
        corners = self._scale * corners
        self._static = StaticScene(solid, self._camera, self._rasterizer, light)
        self._edges = _container_edges(corners, self._camera)
        # Water casts shadows on the solid and on the floor, up to the reach of a low sun. Shadows are soft, so one
        # point for each pixel of the picture is enough.
        depth = self._static.depth[::_SUPERSAMPLING, ::_SUPERSAMPLING]
        finite = np.isfinite(depth)
        rays = self._rays[::_SUPERSAMPLING, ::_SUPERSAMPLING]
        points = self._camera.eye.astype(np.float32) + np.where(finite, depth, 0.0)[..., None] * rays
        self._receives_shadow = finite & (np.abs(points[..., :2]).max(-1) < 2.0 * max(self._container_size))
        self._shadow_points = points[self._receives_shadow] @ light_space_axes().T
        self._rasterizer.set_perspective(self._camera, *clipping_range(self._camera))

    def omit_edges(self) -> None:
        """Draw no edges of the container, which is open."""
        self._draws_edges = False

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
        if self._draws_edges:
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


def _container_edges(corners: np.ndarray, camera: Camera) -> _Edges:
    """The pixels on the twelve edges of a container with ``corners`` (8, 3)."""
    z = float(corners[:, 2].max())
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
