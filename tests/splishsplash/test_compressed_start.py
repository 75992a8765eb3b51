"""Where the solver throws water apart, a line says so before."""

import warnings

import pytest

from surfsup.scene import Scene
from surfsup.splishsplash.compressed_start import PressedWater, warn_of_pressed_water


def warn(x: float, y: float) -> None:
    """Of a block that begins so far from two walls of a container of 0.6 m, clear of all others."""
    text = (
        "container: {size: [0.6, 0.6, 1]}\n"
        f"fluid: [{{block: {{min: [{x - 0.3}, {y - 0.3}, 0.3], max: [0.1, 0.1, 0.5]}}}}]"
    )
    scene = Scene.from_yaml(text, "test")
    warn_of_pressed_water(scene, scene.start(None))


@pytest.mark.parametrize(("x", "y"), [(0.02, 0.02), (0.006, 0.1), (0.1, 0.1)])
def test_water_with_room_is_left_in_peace(x, y):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn(x, y)


def test_water_close_to_one_wall_is_named():
    with pytest.warns(PressedWater, match=r"it begins 0\.030 m from a wall, .* leave 0\.034 m"):
        warn(0.0, 0.2)


def test_water_in_a_corner_needs_more_room():
    with pytest.warns(PressedWater, match=r"it begins 0\.036 m from several walls, .* leave 0\.049 m"):
        warn(0.006, 0.006)
