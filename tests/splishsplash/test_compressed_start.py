"""A warning names fluid that the solver would throw apart."""

import warnings

import pytest

from surfsup.scene import Scene
from surfsup.splishsplash.compressed_start import CompressedStartWarning, warn_compressed_start


def warn(x: float, y: float) -> None:
    """Check a block at the distances x and y from two walls of a container of 0.6 m, and far from all others."""
    text = (
        "container: {size: [0.6, 0.6, 1]}\n"
        f"fluid: [{{block: {{min: [{x - 0.3}, {y - 0.3}, 0.3], max: [0.1, 0.1, 0.5]}}}}]"
    )
    scene = Scene.from_yaml(text, "test")
    warn_compressed_start(scene, scene.initial_particles(None))


@pytest.mark.parametrize(("x", "y"), [(0.02, 0.02), (0.006, 0.1), (0.1, 0.1)])
def test_fluid_far_from_walls_gives_no_warning(x, y):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn(x, y)


def test_fluid_close_to_one_wall_gives_a_warning():
    with pytest.warns(CompressedStartWarning, match=r"it begins 30 mm from a wall, .* leave 34 mm"):
        warn(0.0, 0.2)


def test_fluid_in_a_corner_needs_a_larger_distance():
    with pytest.warns(CompressedStartWarning, match=r"it begins 36 mm from several walls, .* leave 49 mm"):
        warn(0.006, 0.006)
