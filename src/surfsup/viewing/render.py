"""Pictures of a scene's frames: a lit stage that is drawn once, and the water of each frame put onto it."""

import numpy as np
import trimesh

from surfsup.viewing import light
from surfsup.viewing.camera import Camera, frame_camera
from surfsup.viewing.raster import Rasterizer
from surfsup.viewing.stage import Stage, view_range
from surfsup.viewing.water import shade, sun_axes, sunlight, thickness, water_surface

_FINE = 2  # everything is drawn twice as large and averaged, which smooths its edges
_EDGE_COLOR = np.array([0.30, 0.36, 0.42], np.float32)
_EDGE_STRENGTH = 0.55


class FrameRenderer:
    """Draws frames of one scene, all with the same light and camera.

    solid: the mesh that the water meets, in meters, or None.
    container_size: (x, y, z) in meters; x and y are centered on 0, the floor is z = 0.
    particle_radius: half the particles' spacing, meters.
    focus: points (N, 3) that should be in view beside solid and floor, for instance the first frame; or None.
    size: (width, height) of the picture in pixels.

    Raises InputError where this machine cannot draw off screen; the message names the packages to install.
    """

    def __init__(
        self,
        solid: trimesh.Trimesh | None,
        container_size: tuple[float, float, float],
        particle_radius: float,
        focus: np.ndarray | None = None,
        size: tuple[int, int] = (960, 720),
    ) -> None:
        self._radius = particle_radius
        fine = (size[0] * _FINE, size[1] * _FINE)
        bounds = np.asarray(solid.bounds) if solid is not None else None
        self._camera = frame_camera(container_size, bounds, focus, fine)
        self._raster = Rasterizer(fine)
        self._stage = Stage(solid, self._camera, self._raster)
        self._rays = self._camera.rays()
        self._edges = _container_edges(container_size, self._camera)
        # Where water may cast a shadow: on the solid and on the floor, up to as far as a low sun throws it. A
        # shadow is soft, so one point for each pixel of the picture is enough.
        depth = self._stage.depth[::_FINE, ::_FINE]
        finite = np.isfinite(depth)
        rays = self._rays[::_FINE, ::_FINE]
        points = self._camera.eye.astype(np.float32) + np.where(finite, depth, 0.0)[..., None] * rays
        self._ground = finite & (np.abs(points[..., :2]).max(-1) < 2.0 * max(container_size))
        self._ground_along = points[self._ground] @ sun_axes().T
        self._raster.perspective(self._camera, *view_range(self._camera))

    def image(self, positions: np.ndarray) -> np.ndarray:
        """The picture (height, width, 3) uint8 of particles at `positions` (N, 3), meters."""
        positions = np.asarray(positions, np.float32)
        positions = positions[np.isfinite(positions).all(1)]  # a broken rollout is still worth a look
        picture, depth = self._stage.light.copy(), self._stage.depth
        sun = np.ones(self._ground.shape, np.float32)
        sun[self._ground] = sunlight(positions, self._radius, self._ground_along)
        picture *= sun.repeat(_FINE, 0).repeat(_FINE, 1)[..., None]

        surface = water_surface(positions, self._radius)
        if surface.n_points:
            picture, depth = self._add_water(surface, positions, picture)
        _draw_edges(picture, depth, self._edges)
        width, height = self._camera.size
        small = picture.reshape(height // _FINE, _FINE, width // _FINE, _FINE, 3).mean((1, 3))
        return light.to_display(small)

    def _add_water(self, surface: object, positions: np.ndarray, behind: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # A vertex of degenerate triangles only has no normal; any color does, it covers no pixel.
        facing = np.nan_to_num(surface.point_data["Normals"])
        self._raster.hold(surface, (facing * 127.5 + 128.0).astype(np.uint8))
        depth = self._raster.depth()
        rows, columns = np.nonzero(depth < self._stage.depth)
        normals = self._raster.color()[rows, columns].astype(np.float32) / 127.5 - 1.0
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        water = thickness(positions, self._radius, self._camera, self._stage.depth)[rows, columns]
        picture = behind.copy()
        picture[rows, columns] = shade(
            normals, self._rays[rows, columns], depth[rows, columns], water, rows, columns,
            behind, self._stage.depth, self._camera,
        )  # fmt: skip
        return picture, np.minimum(depth, self._stage.depth)

    def close(self) -> None:
        """Free the off-screen window."""
        self._raster.close()


def _container_edges(
    container_size: tuple[float, float, float], camera: Camera
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns, depth and strength of the pixels on the container's twelve edges."""
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
        # Upright edges fade as they rise: glass that is there, not a cage.
        strength = _EDGE_STRENGTH * np.clip(1.0 - 0.75 * points[:, 2] / z, 0.2, 1.0)
        for aside in ((0, 0), (1, 0), (0, 1), (1, 1)):
            column, row = np.floor(pixels + aside - 0.5).astype(int).T
            seen = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            found.append(np.stack([row, column, depth, strength], 1)[seen])
    rows, columns, depth, strength = np.concatenate(found).T
    _, first = np.unique(rows.astype(int) * width + columns.astype(int), return_index=True)
    return (
        rows[first].astype(int),
        columns[first].astype(int),
        depth[first],
        strength[first].astype(np.float32),
    )


def _draw_edges(
    picture: np.ndarray, depth: np.ndarray, edges: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
) -> None:
    rows, columns, edge_depth, strength = edges
    front = edge_depth < depth[rows, columns] + 0.01  # the floor's own edges lie in the floor
    rows, columns, strength = rows[front], columns[front], strength[front, None]
    picture[rows, columns] += strength * (_EDGE_COLOR - picture[rows, columns])
