"""The studio's light: a sun, a sky that brightens upwards and what they do to a point; all in linear color,
white is 1.
"""

import numpy as np

SUN = np.array([-0.45, -0.42, 0.79])  # towards the sun; behind the camera's left shoulder
SUN /= np.linalg.norm(SUN)
SUN_COLOR = np.array([1.0, 0.94, 0.84], np.float32) * 1.0
SKY_ZENITH = np.array([0.56, 0.68, 0.86], np.float32)
SKY_HORIZON = np.array([0.93, 0.95, 0.97], np.float32)
GROUND = np.array([0.80, 0.81, 0.82], np.float32)  # the share of light, by color, that the floor gives back
_SUN_RADIUS = 0.09  # radians; wider than the real one's, for soft shadows


def sky_directions(count: int) -> np.ndarray:
    """Directions (count, 3) spread evenly over the upper hemisphere (a Fibonacci spiral), unit length."""
    i = np.arange(count) + 0.5
    z = i / count
    turn = np.pi * (3.0 - 5.0**0.5) * i
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], 1)


def sun_directions(count: int) -> np.ndarray:
    """Directions (count, 3) spread evenly over the sun's disc, unit length."""
    i = np.arange(count) + 0.5
    radius, turn = _SUN_RADIUS * np.sqrt(i / count), np.pi * (3.0 - 5.0**0.5) * i
    aside = np.cross(SUN, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    spread = np.cos(turn)[:, None] * aside + np.sin(turn)[:, None] * np.cross(SUN, aside)
    directions = SUN + radius[:, None] * spread
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def sky_dome(directions: np.ndarray) -> np.ndarray:
    """Light (..., 3) of the sky in unit `directions` (..., 3) that point upwards, float32."""
    blend = np.clip(directions[..., 2:], 0.0, 1.0).astype(np.float32) ** 0.6
    return SKY_HORIZON + blend * (SKY_ZENITH - SKY_HORIZON)


def surroundings(directions: np.ndarray) -> np.ndarray:
    """Light (..., 3) from unit `directions` (..., 3): the sky above, the lit floor below and a bright
    window, float32.
    """
    light = sky_dome(directions)
    light = light + np.clip(-directions[..., 2:] * 5.0, 0.0, 1.0) * (GROUND * 0.85 - light)
    # A window over the sun's shoulder is what gives water its broad highlights.
    towards = directions @ SUN.astype(np.float32)
    window = np.clip((towards - 0.86) / 0.06, 0.0, 1.0)[..., None]
    return light + (window * window * (3.0 - 2.0 * window)) * np.float32(1.6)


def to_display(light: np.ndarray) -> np.ndarray:
    """Linear light as sRGB-like bytes, uint8, the same shape; brighter than white rolls off instead of
    clipping.
    """
    rolled = np.where(light < 0.8, light, 0.8 + 0.2 * (1.0 - np.exp(-(light - 0.8) / 0.2)))
    return (np.clip(rolled, 0.0, 1.0) ** (1 / 2.2) * 255.0 + 0.5).astype(np.uint8)


FROM_DISPLAY = ((np.arange(256) / 255.0) ** 2.2).astype(np.float32)
"""Linear light (256,) of a byte that `to_display` gave, below its roll-off."""
