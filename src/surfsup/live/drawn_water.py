"""The water of a live page: particles colored by their speed, or surfaces, in the colors of the liquids."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from surfsup.errors import SimulationError
from surfsup.scene import Scene
from surfsup.scene.liquid import Liquid
from surfsup.simulation_state import Frame
from surfsup.viewing.liquid_look import color_of
from surfsup.viewing.reconstruction import Reconstruction

if TYPE_CHECKING:
    import viser

PARTICLES, SURFACE = "particles", "surface"
# From slow to fast.
PALETTE = np.array([(45, 120, 200), (80, 175, 230), (240, 249, 253)], np.float32)
POINT = 1.2  # particle radii; of a disc, which viser draws with twice this as its diameter
FAST_SPEED = 3.0  # m/s, with particles of 15 mm
WATER_COLOR = (60, 150, 215)
COARSE_SURFACE = Reconstruction(cube_size=1.4, mesh_smoothing=8, normal_smoothing=0)  # viser has its own normals

Triangles = tuple[np.ndarray, np.ndarray]  # vertices (V, 3) and corners (T, 3)


class DrawnWater:
    """What a page shows of the liquids of a scene.

    A surface takes longer than several steps, so a thread makes it while the water runs on, and the next one is of the
    newest frame.

    Args:
        server: of viser.
        scene: with the liquids.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._making: Future[dict[str, Triangles]] | None = None
        self._waiting: tuple[Frame, float] | None = None
        self._scene, self._shapes = server.scene, dict[str, Any]()
        self._colors = [colors_of(liquid) for liquid in scene.mixture or [scene.liquid]]

    def show(self, frame: Frame, style: str, radius: float) -> bool:
        """Draw the water of a frame as PARTICLES, or as SURFACE as soon as that is made; returns whether it drew."""
        if style == PARTICLES:
            self._waiting = self._making = None
            self._show_particles(frame, radius)
            return True
        self._waiting = (frame, radius)
        return self.update()

    def update(self) -> bool:
        """Draw a surface that was made meanwhile, and begin with the newest one; returns whether one was drawn."""
        drawn = self._making is not None and self._making.done()
        if self._making is not None and drawn:
            with suppress(SimulationError):  # there is none around these particles; the next one will do
                self._show_surfaces(self._making.result())
            self._making = None
        if self._making is None and self._waiting is not None:
            self._making = self._thread.submit(self._surfaces, *self._waiting)
            self._waiting = None
        return drawn

    @property
    def is_up_to_date(self) -> bool:
        """Whether no surface is being made or waits for it."""
        return self._making is None and self._waiting is None

    def _show_particles(self, frame: Frame, radius: float) -> None:
        self._remove_all_but({PARTICLES})
        fast = FAST_SPEED * np.sqrt(radius / 0.015)
        colors = np.empty((len(frame.positions), 3), np.uint8)
        for number, (palette, _) in enumerate(self._colors):
            own = self._of(frame, number)
            colors[own] = speed_colors(frame.velocities[own], fast, palette)
        if PARTICLES not in self._shapes:
            self._shapes[PARTICLES] = self._scene.add_point_cloud(
                PARTICLES, frame.positions, colors, point_size=POINT * radius, point_shape="circle"
            )
            return
        points = self._shapes[PARTICLES]
        points.points, points.colors = frame.positions, colors
        points.point_size = POINT * radius

    def _surfaces(self, frame: Frame, radius: float) -> dict[str, Triangles]:
        """The surfaces of the liquids that have particles, by the names of their shapes."""
        import pysplashsurf

        made = {}
        for number in range(len(self._colors)):
            positions = frame.positions[self._of(frame, number)]
            if len(positions):
                mesh = COARSE_SURFACE.mesh(positions, radius).mesh
                assert isinstance(mesh, pysplashsurf.TriMesh3d)  # quads are not requested
                made[f"{SURFACE}-{number}"] = (
                    np.asarray(mesh.vertices, np.float32),
                    np.asarray(mesh.triangles, np.uint32),
                )
        return made

    def _show_surfaces(self, surfaces: dict[str, Triangles]) -> None:
        self._remove_all_but(set(surfaces))
        for name, (vertices, triangles) in surfaces.items():
            _, color = self._colors[int(name.rpartition("-")[2])]
            self._shapes[name] = self._scene.add_mesh_simple(
                name, vertices, triangles, color=color, opacity=0.75, cast_shadow=False
            )

    def _of(self, frame: Frame, number: int) -> np.ndarray | slice:
        """The particles of a liquid."""
        return slice(None) if frame.liquids is None else frame.liquids == number

    def _remove_all_but(self, names: set[str]) -> None:
        for name in set(self._shapes) - names:
            self._shapes.pop(name).remove()


def colors_of(liquid: Liquid | None) -> tuple[np.ndarray, tuple[int, int, int]]:
    """The colors (3, 3) of slow, middle and fast particles of a liquid, from 0 to 255, and that of its surface."""
    color = color_of(liquid)
    if color is None:
        return PALETTE, WATER_COLOR
    middle = 255 * np.array(color, np.float32)
    red, green, blue = (int(part) for part in middle)
    return np.stack([0.75 * middle, middle, 0.3 * middle + 178]), (red, green, blue)


def speed_colors(velocities: np.ndarray, fast: float, palette: np.ndarray = PALETTE) -> np.ndarray:
    """Colors (N, 3) uint8 of particles by their speed, m/s: from slow to fast through a ``palette`` (3, 3)."""
    share = np.clip(np.sqrt((velocities**2).sum(1)) / np.float32(fast), 0, 1)[:, None]
    lower, upper = np.clip(2 * share, 0, 1), np.clip(2 * share - 1, 0, 1)
    slow, middle, fastest = palette
    colors: np.ndarray = (slow + lower * (middle - slow) + upper * (fastest - middle)).astype(np.uint8)
    return colors
