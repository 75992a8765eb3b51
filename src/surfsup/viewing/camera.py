"""A pinhole camera, and where to put it so that the solid, the water and the container's floor fill the
picture.
"""

from dataclasses import dataclass

import numpy as np

FIELD_OF_VIEW = 26.0  # degrees, upright; long enough a lens that a box does not look like a pyramid
_TOWARDS_CAMERA = np.array([0.50, -0.86, 0.40])  # from the front, a little to the right, looking down by 22 degrees
_MARGIN = 1.03
_HEADROOM = 0.06  # meters above the highest point of interest


@dataclass(frozen=True)
class Camera:
    """A pinhole camera at `eye` (3,) that looks at `target` (3,), z up, for pictures of `size` (width,
    height) pixels.
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
    def pixels_a_meter(self) -> float:
        """Pixels that one meter covers at a depth of one meter."""
        return self.size[1] / 2 / np.tan(np.radians(FIELD_OF_VIEW) / 2)

    def project(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixel (N, 2), x to the right and y down, and depth (N,) in meters, of points (N, 3)."""
        local = (points - self.eye) @ self.axes.T
        pixels = local[:, :2] / local[:, 2:] * self.pixels_a_meter * [1.0, -1.0]
        return pixels + np.array(self.size) / 2, local[:, 2]

    def rays(self) -> np.ndarray:
        """A ray (height, width, 3) through the center of each pixel, one meter deep: a point is `eye
        + depth * ray`.
        """
        width, height = self.size
        x = (np.arange(width) + 0.5 - width / 2) / self.pixels_a_meter
        y = (height / 2 - np.arange(height) - 0.5) / self.pixels_a_meter
        right, up, forward = self.axes
        return (forward + x[None, :, None] * right + y[:, None, None] * up).astype(np.float32)


def frame_camera(
    container_size: tuple[float, float, float],
    solid_bounds: np.ndarray | None,
    focus: np.ndarray | None,
    size: tuple[int, int],
) -> Camera:
    """A camera whose picture holds the container's floor, the solid and the points of interest, and no empty
    tower above.

    `container_size` is (x, y, z) in meters; `solid_bounds` (2, 3) and `focus` (N, 3) are in meters and may be
    None; without either the whole container is in view, with either only as much of it as they reach up.
    """
    half = np.array(container_size[:2]) / 2
    tops = [solid_bounds[1, 2]] if solid_bounds is not None else []
    # Not the very top: water that hangs high before it falls may reach out of the picture, for the
    # solid is what matters.
    tops += [np.quantile(focus[:, 2], 0.6)] if focus is not None and len(focus) else []
    top = min(max(tops) + _HEADROOM, container_size[2]) if tops else container_size[2]
    corners = np.array([[x, y, z] for x in (-half[0], half[0]) for y in (-half[1], half[1]) for z in (0.0, top)])
    towards = _TOWARDS_CAMERA / np.linalg.norm(_TOWARDS_CAMERA)

    target, distance = np.array([0.0, 0.0, top / 2]), float(np.linalg.norm(corners, axis=1).max()) * 4
    for _ in range(8):  # center and distance depend on each other; this settles within a few rounds
        camera = Camera(target + towards * distance, target, size)
        pixels, depth = camera.project(corners)
        center = (pixels.min(0) + pixels.max(0)) / 2 - np.array(size) / 2
        meters = center * distance / camera.pixels_a_meter
        target = target + meters[0] * camera.axes[0] - meters[1] * camera.axes[1]
        # Moving the camera by d changes every corner's depth by d: the distance at which the
        # widest one just fits.
        reach = np.abs(pixels - np.array(size) / 2 - center) / (np.array(size) / 2) * depth[:, None]
        distance += float((reach * _MARGIN - depth[:, None]).max())
    return Camera(target + towards * distance, target, size)
