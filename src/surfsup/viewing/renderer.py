"""Pictures of a scene's frames: the scene without water is drawn once, then each frame adds its water.

A frame changes a box of the picture, and only that is drawn anew. Water is shaded once for each pixel that it covers
whole, and for each sample of pixels on its rim.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from surfsup.viewing import lighting
from surfsup.viewing.camera import DEFAULT_DIRECTION, ViewDirection, fit_camera, picture_scale
from surfsup.viewing.container_edges import ContainerEdges
from surfsup.viewing.liquid_look import WATER, LiquidLook, mixed_look
from surfsup.viewing.lit_solid import LitSolid
from surfsup.viewing.moving_mesh import container_corners
from surfsup.viewing.pixel_box import PixelBox
from surfsup.viewing.rasterizer import Rasterizer
from surfsup.viewing.shading_mesh import ShadingMesh
from surfsup.viewing.shadow_maps import FULL_LIGHT, MOVING_LIGHT, Light
from surfsup.viewing.static_view import StaticView, clipping_range
from surfsup.viewing.viewpoint import SUPERSAMPLING, Viewpoint, repeated
from surfsup.viewing.water import (
    Background,
    Samples,
    reconstruct_surface,
    shade_water,
    water_thickness,
)
from surfsup.viewing.water_shadow import ShadowReceiver

_MARGIN = 16  # pixels around the water, for what refraction shows of its surroundings


@dataclass(frozen=True)
class DryPicture:
    """The scene of a frame without its water, and its tone-mapped picture (H, W, 3)."""

    view: StaticView
    receiver: ShadowReceiver
    edges: ContainerEdges
    picture: np.ndarray


@dataclass(frozen=True)
class DrawnWater:
    """The front of the water in a box of the picture, before shading.

    Attributes:
        positions: (N, 3) of the particles of each liquid, meters.
        box: of the picture.
        depth: (2 h, 2 w) of its samples, infinite without water.
        colors: (2 h, 2 w, 3) uint8, the normals.
        dry: the picture behind it.
    """

    positions: list[np.ndarray]
    box: PixelBox
    depth: np.ndarray
    colors: np.ndarray
    dry: DryPicture


class FrameRenderer:
    """Renders the frames of one scene with fixed light and camera.

    Args:
        solid: the mesh of the solid, meters, or None.
        container_size: (x, y, z), meters; x and y are centered on 0, the floor is at z = 0.
        particle_radius: half the particle spacing, meters.
        bounds: corners (2, 3) of a box that solids which move stay in, meters, or None.
        focus: points (N, 3) to show beside solid and floor, for instance the particles of frame 0; or None.
        size: (width, height) of the picture in pixels.
        direction: from where the camera looks.
        turntable: whether the camera shall go around, by :meth:`turn`.
        looks: of the liquids.
        liquids: (N,), which of them each particle is; None for the first.

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
        direction: ViewDirection = DEFAULT_DIRECTION,
        turntable: bool = False,
        looks: Sequence[LiquidLook] = (WATER,),
        liquids: np.ndarray | None = None,
    ) -> None:
        self._looks, self._liquids = looks, liquids
        self._scale = picture_scale(container_size, particle_radius)
        x, y, z = (self._scale * side for side in container_size)
        self._radius, self._container_size = self._scale * particle_radius, (x, y, z)
        focus = None if focus is None else self._scale * focus
        if bounds is None and solid is not None:
            bounds = np.asarray(solid.bounds)
        bounds = None if bounds is None else self._scale * bounds
        self._camera = fit_camera(self._container_size, bounds, focus, size, direction, turntable)
        self._first_camera = self._camera
        self._viewpoint, self._rasterizer, self._draws_edges = Viewpoint(self._camera), Rasterizer(), True
        self.set_solid(solid, container_corners(container_size, {}, 0), FULL_LIGHT)

    def set_solid(self, solid: trimesh.Trimesh | None, corners: np.ndarray, light: Light = MOVING_LIGHT) -> None:
        """Draw ``solid`` and a container with ``corners`` (8, 3) in meters from now on."""
        if self._scale != 1 and solid is not None:
            solid = solid.copy().apply_scale(self._scale)
        self._solid, self._corners = LitSolid(solid, self._rasterizer, light), self._scale * corners
        self._draw_dry()

    def turn(self, degrees: float) -> None:
        """Look from a camera that has turned so far about the vertical axis."""
        self._camera = self._first_camera.turned(degrees)
        self._viewpoint = Viewpoint(self._camera)
        self._draw_dry()

    def omit_edges(self) -> None:
        """Draw no edges of the container, which is open."""
        self._draws_edges = False
        self._draw_dry()

    def _draw_dry(self) -> None:
        view = StaticView(self._solid, self._viewpoint, self._rasterizer)
        edges = ContainerEdges.of(self._corners, self._camera) if self._draws_edges else ContainerEdges.none()
        radiance = view.radiance.copy()
        edges.draw(radiance, view.fine_depth, PixelBox.whole(self._camera.size))
        receiver = ShadowReceiver(view, max(self._container_size[:2]))
        self._dry = DryPicture(view, receiver, edges, to_picture(radiance))

    def render(self, positions: np.ndarray) -> np.ndarray:
        """The picture (height, width, 3) uint8 of particles at ``positions`` (N, 3), meters.

        Particles with a non-finite position are left out.
        """
        return self.shade(self.draw(*self.reconstruct(positions)))

    def reconstruct(self, positions: np.ndarray) -> tuple[list[np.ndarray], ShadingMesh]:
        """The first of three parts of :meth:`render`: positions of each liquid as drawn, and the surface of all.

        Only the second part, :meth:`draw`, is bound to the thread that made the renderer.
        """
        positions = np.asarray(positions, np.float32)
        there = np.isfinite(positions).all(1)
        positions = np.float32(self._scale) * positions[there]
        parts = [positions]
        if self._liquids is not None:
            parts = [positions[self._liquids[there] == number] for number in range(len(self._looks))]
        return parts, reconstruct_surface(positions, self._radius)

    def draw(self, positions: list[np.ndarray], surface: ShadingMesh) -> DrawnWater:
        """The second part: the front of the water."""
        pixels, _ = self._camera.project(surface.vertices)
        box = PixelBox.around(pixels, _MARGIN, self._camera.size)
        if len(surface.faces) == 0:
            width, height = (SUPERSAMPLING * side for side in box.size)
            empty = np.full((height, width), np.float32(np.inf))
            return DrawnWater(positions, box, empty, np.zeros((height, width, 3), np.uint8), self._dry)
        self._rasterizer.set_perspective(self._camera, box, SUPERSAMPLING, *clipping_range(self._camera))
        colors = (surface.normals * np.float32(127.5) + np.float32(128.0)).astype(np.uint8)
        self._rasterizer.set_mesh(surface.vertices, surface.faces, colors)
        depth = self._rasterizer.render_depth()
        return DrawnWater(positions, box, depth, self._rasterizer.color(), self._dry)

    def shade(self, water: DrawnWater) -> np.ndarray:
        """The last part: the picture (height, width, 3) uint8."""
        dry, (width, _) = water.dry, self._camera.size  # all cameras have pictures of one size
        shadow = dry.receiver.shade(np.concatenate(water.positions), self._radius)
        box = shadow.box.union(water.box)
        light = shadow.light_in(box, width)
        radiance = dry.view.radiance[:, *box.slices()] * light
        depth = dry.view.fine_depth[box.slices(SUPERSAMPLING)].copy()
        self._add_water(water, box, radiance, light, depth)
        dry.edges.draw(radiance, depth, box)
        picture = dry.picture.copy()
        picture[box.slices()] = to_picture(radiance)
        return picture

    def _add_water(
        self, water: DrawnWater, box: PixelBox, radiance: np.ndarray, light: np.ndarray, fine_depth: np.ndarray
    ) -> None:
        """Shade the water into ``radiance`` (3, h, w) of a box; its depth enters ``fine_depth`` (2 h, 2 w)."""
        view, camera = water.dry.view, water.dry.view.viewpoint.camera
        # The part of the box where water is.
        top, left = water.box.top - box.top, water.box.left - box.left
        inner = PixelBox(top, top + water.box.size[1], left, left + water.box.size[0])
        behind = fine_depth[inner.slices(SUPERSAMPLING)].copy()
        wet = water.depth < behind
        fine_depth[inner.slices(SUPERSAMPLING)] = np.minimum(water.depth, behind)
        depth = behind[::SUPERSAMPLING, ::SUPERSAMPLING]
        layers = [water_thickness(part, self._radius, camera, water.box, depth) for part in water.positions]
        thickness = layers[0] if len(layers) == 1 else sum(layers[1:], layers[0])
        count = _counts(wet)
        whole, rim = count == SUPERSAMPLING**2, (count > 0) & (count < SUPERSAMPLING**2)
        coarse, light = radiance[:, *inner.slices()], light[inner.slices()]
        fine = view.fine_radiance[:, *water.box.slices(SUPERSAMPLING)]
        views = view.viewpoint.views[:, *water.box.slices()]
        background = coarse.copy()

        def samples(rows: np.ndarray, columns: np.ndarray, factor: int) -> Samples:
            """Those at rows and columns of a grid with ``factor`` samples a pixel along each axis."""
            step = SUPERSAMPLING // factor
            at, pixel = (step * rows, step * columns), (rows // factor, columns // factor)
            normals = water.colors[at].T.astype(np.float32) - np.float32(127.5)
            if step > 1:  # the mean of a pixel's normals; its depth is that of one of them
                normals = sum(
                    (water.colors[at[0] + a, at[1] + b].T.astype(np.float32) - np.float32(127.5))
                    for a in range(step)
                    for b in range(step)
                )
            normals /= np.sqrt(np.einsum("ij,ij->j", normals, normals))
            look = self._looks[0] if len(layers) == 1 else mixed_look(self._looks, [each[pixel] for each in layers])
            return Samples(normals, views[:, *pixel], water.depth[at], thickness[pixel], look, rows, columns)

        rows, columns = np.nonzero(whole)
        pixels = Background(lambda r, c: background[:, r, c], depth, camera.focal_length)
        coarse[:, rows, columns] = shade_water(samples(rows, columns, 1), pixels, camera.axes)

        rows, columns = np.nonzero(repeated(rim) & wet)
        grid = Background(
            lambda r, c: fine[:, r, c] * light[r // SUPERSAMPLING, c // SUPERSAMPLING],
            behind,
            SUPERSAMPLING * camera.focal_length,
        )
        shaded = shade_water(samples(rows, columns, SUPERSAMPLING), grid, camera.axes)
        change = (shaded - grid.radiance(rows, columns)) / SUPERSAMPLING**2
        height, width = thickness.shape
        pixel = rows // SUPERSAMPLING * width + columns // SUPERSAMPLING
        for channel, part in zip(coarse, change, strict=True):
            channel += np.bincount(pixel, part, height * width).reshape(height, width)

    def close(self) -> None:
        """Free the off-screen window."""
        self._rasterizer.close()


def to_picture(radiance: np.ndarray) -> np.ndarray:
    """The tone-mapped picture (H, W, 3) uint8 of ``radiance`` (3, H, W)."""
    return np.ascontiguousarray(np.moveaxis(lighting.tone_map(radiance), 0, -1))


def _counts(wet: np.ndarray) -> np.ndarray:
    """How many samples (H, W) of each pixel are ``wet`` (2 H, 2 W)."""
    parts = wet.view(np.uint8)
    return parts[::2, ::2] + parts[1::2, ::2] + parts[::2, 1::2] + parts[1::2, 1::2]
