"""A pinhole camera, and its placement so that the solid, the water and the container's floor fill the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from surfsup.errors import InputError
from surfsup.scene import PARTICLE_RADIUS

FIELD_OF_VIEW = 26.0  # degrees, vertical; a long lens with little perspective distortion
_MARGIN = 1.03
_HEADROOM = 0.06  # meters above the highest point of interest


def picture_scale(container_size: tuple[float, float, float], particle_radius: float) -> float:
    """Factor of all lengths of a scene in its pictures, whose light, shadows and margins suit a container of 1 m.

    Scenes with particles of another radius than the standard one are drawn at that size.
    """
    return 1.0 if particle_radius == PARTICLE_RADIUS else 1.0 / max(container_size[:2])


@dataclass(frozen=True)
class ViewDirection:
    """From where a camera looks at the scene.

    Attributes:
        azimuth: degrees about z from x, counterclockwise as seen from above; -90 is the front.
        elevation: degrees above the floor, above 0 and at most 89.
        zoom: 1 shows container and solid as large as they fit; 2 shows their middle twice as large.

    Raises:
        InputError: a value is out of range.
    """

    azimuth: float
    elevation: float
    zoom: float = 1.0

    def __post_init__(self) -> None:
        if not -360 <= self.azimuth <= 360:
            raise InputError(f"camera: an azimuth of {self.azimuth:g} degrees is not between -360 and 360")
        if not 1 <= self.elevation <= 89:
            raise InputError(f"camera: an elevation of {self.elevation:g} degrees is not between 1 and 89")
        if not 0.1 <= self.zoom <= 20:
            raise InputError(f"camera: a zoom of {self.zoom:g} is not between 0.1 and 20")

    @property
    def vector(self) -> np.ndarray:
        """Unit vector (3,) towards the camera."""
        azimuth, elevation = np.radians([self.azimuth, self.elevation])
        return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


DEFAULT_DIRECTION = ViewDirection(-59.83, 21.91)  # from the front right


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; z is up.

    Attributes:
        eye: position (3,), meters.
        target: point (3,) in the center of the picture, meters.
        size: (width, height) of the picture in pixels.
    """

    eye: np.ndarray
    target: np.ndarray
    size: tuple[int, int]

    @property
    def axes(self) -> np.ndarray:
        """The rows right, up and forward (3, 3), unit length, in world coordinates."""
        forward = (self.target - self.eye) / np.linalg.norm(self.target - self.eye)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])

    @property
    def focal_length(self) -> float:
        """In pixels: the size of one meter at a depth of one meter."""
        return self.size[1] / 2 / np.tan(np.radians(FIELD_OF_VIEW) / 2)

    def turned(self, degrees: float) -> Camera:
        """The camera after a turn about the vertical axis through the container's center."""
        turn = np.radians(degrees)
        rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        return Camera(rotation @ self.eye, rotation @ self.target, self.size)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixel (N, 2), x to the right and y down, and depth (N,) in meters, of points (N, 3)."""
        local = (points - self.eye) @ self.axes.T
        pixels = local[:, :2] / local[:, 2:] * self.focal_length * [1.0, -1.0]
        return pixels + np.array(self.size) / 2, local[:, 2]

    def rays(self, samples: int = 1) -> np.ndarray:
        """A ray (height, width, 3) through each pixel's center, of depth one: a point is ``eye + depth * ray``.

        With more ``samples`` along each axis of a pixel, height and width are so many times as large.
        """
        width, height = self.size
        x = ((np.arange(samples * width) + 0.5) / samples - width / 2) / self.focal_length
        y = (height / 2 - (np.arange(samples * height) + 0.5) / samples) / self.focal_length
        right, up, forward = self.axes
        return (forward + x[None, :, None] * right + y[:, None, None] * up).astype(np.float32)


def fit_camera(
    container_size: tuple[float, float, float],
    solid_bounds: np.ndarray | None,
    focus: np.ndarray | None,
    size: tuple[int, int],
    direction: ViewDirection = DEFAULT_DIRECTION,
    turntable: bool = False,
) -> Camera:
    """A camera whose picture shows the container's floor, the solid and the points of interest, without empty space.

    Args:
        container_size: (x, y, z), meters.
        solid_bounds: lower and upper corner (2, 3), meters, or None.
        focus: points of interest (N, 3), meters, or None. Without solid and focus the whole container is in view.
        size: (width, height) of the picture in pixels.
        direction: of the camera.
        turntable: whether all that shall stay in the picture while the camera goes around.
    """
    half = np.array(container_size[:2]) / 2
    tops = [solid_bounds[1, 2]] if solid_bounds is not None else []
    tops += [focus[:, 2].max()] if focus is not None and len(focus) else []
    top = min(max(tops) + _HEADROOM, container_size[2]) if tops else container_size[2]
    floor = [half * [x, y] for x in (-1, 1) for y in (-1, 1)]
    if turntable:
        circle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
        floor = list(np.hypot(*half) * np.stack([np.cos(circle), np.sin(circle)], 1))
    corners = np.array([[x, y, z] for x, y in floor for z in (0.0, top)])
    towards = direction.vector

    target, distance = np.array([0.0, 0.0, top / 2]), float(np.linalg.norm(corners, axis=1).max()) * 4
    for _ in range(8):  # center and distance depend on each other; the iteration converges quickly
        camera = Camera(target + towards * distance, target, size)
        pixels, depth = camera.project(corners)
        center = (pixels.min(0) + pixels.max(0)) / 2 - np.array(size) / 2
        meters = center * distance / camera.focal_length
        target = target + meters[0] * camera.axes[0] - meters[1] * camera.axes[1]
        # Moving the camera back by d adds d to every corner's depth, so this is where the widest corner just fits.
        required_depth = np.abs(pixels - np.array(size) / 2 - center) / (np.array(size) / 2) * depth[:, None]
        distance += float((required_depth * _MARGIN - depth[:, None]).max())
    return Camera(target + towards * (distance / direction.zoom), target, size)
