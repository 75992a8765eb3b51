"""Light of the scene: a sun, a sky that is brighter at the horizon, and tone mapping. Colors are linear, white is 1."""

import numpy as np

SUN_DIRECTION = np.array([-0.45, -0.42, 0.79])  # towards the sun, behind the camera's left shoulder
SUN_DIRECTION /= np.linalg.norm(SUN_DIRECTION)
SUN_COLOR = np.array([1.0, 0.94, 0.84], np.float32) * 1.0
SKY_ZENITH = np.array([0.56, 0.68, 0.86], np.float32)
SKY_HORIZON = np.array([0.93, 0.95, 0.97], np.float32)
FLOOR_ALBEDO = np.array([0.80, 0.81, 0.82], np.float32)
_SUN_RADIUS = 0.09  # radians; larger than the real sun's, for soft shadows


def sky_directions(count: int) -> np.ndarray:
    """Unit directions (count, 3), evenly spread over the upper hemisphere (a Fibonacci spiral)."""
    i = np.arange(count) + 0.5
    z = i / count
    angle = np.pi * (3.0 - 5.0**0.5) * i
    horizontal = np.sqrt(1.0 - z * z)
    return np.stack([horizontal * np.cos(angle), horizontal * np.sin(angle), z], 1)


def sun_directions(count: int) -> np.ndarray:
    """Unit directions (count, 3), evenly spread over the sun's disc."""
    i = np.arange(count) + 0.5
    radius, angle = _SUN_RADIUS * np.sqrt(i / count), np.pi * (3.0 - 5.0**0.5) * i
    tangent = np.cross(SUN_DIRECTION, [0.0, 0.0, 1.0])
    tangent /= np.linalg.norm(tangent)
    offset = np.cos(angle)[:, None] * tangent + np.sin(angle)[:, None] * np.cross(SUN_DIRECTION, tangent)
    directions = SUN_DIRECTION + radius[:, None] * offset
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def sky_radiance(directions: np.ndarray) -> np.ndarray:
    """Radiance (..., 3) float32 of the sky in unit ``directions`` (..., 3) that point upwards."""
    blend = np.clip(directions[..., 2:], 0.0, 1.0).astype(np.float32) ** 0.6
    return SKY_HORIZON + blend * (SKY_ZENITH - SKY_HORIZON)


def environment_radiance(directions: np.ndarray) -> np.ndarray:
    """Radiance (3, N) float32 from unit ``directions`` (3, N): sky, lit floor and a bright window."""
    height = directions[2]
    blend = np.clip(height, 0.0, 1.0) ** np.float32(0.6)
    ground = np.clip(height * np.float32(-5.0), 0.0, 1.0)
    radiance = SKY_HORIZON[:, None] + blend * (SKY_ZENITH - SKY_HORIZON)[:, None]
    radiance += ground * (FLOOR_ALBEDO[:, None] * np.float32(0.85) - radiance)
    # The window around the sun gives water its broad highlights.
    cosine = SUN_DIRECTION.astype(np.float32) @ directions
    window = np.clip((cosine - np.float32(0.86)) / np.float32(0.06), 0.0, 1.0)
    return radiance + window * window * (3.0 - 2.0 * window) * np.float32(1.6)


def _byte_table() -> np.ndarray:
    radiance = np.arange(_TABLE_SIZE) / _TABLE_STEPS
    compressed = np.where(radiance < 0.8, radiance, 0.8 + 0.2 * (1.0 - np.exp(-(radiance - 0.8) / 0.2)))
    return (compressed ** (1 / 2.2) * 255.0 + 0.5).astype(np.uint8)


_TABLE_STEPS, _TABLE_SIZE = 16_384, 65_536  # the table ends at a radiance of 4, where all is white
_BYTES = _byte_table()


def tone_map(radiance: np.ndarray) -> np.ndarray:
    """Linear color as gamma-encoded uint8 of the same shape; highlights are compressed instead of clipped."""
    index = np.clip(radiance * np.float32(_TABLE_STEPS), 0, _TABLE_SIZE - 1).astype(np.uint16)
    return _BYTES[index]


LINEAR_FROM_BYTE = ((np.arange(256) / 255.0) ** 2.2).astype(np.float32)
"""Linear color (256,) of a byte from ``tone_map``, below the compressed highlights."""
