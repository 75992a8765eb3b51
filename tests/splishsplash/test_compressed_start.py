"""Fluid that the solver would throw apart is moved apart, and a warning says so."""

import re
import warnings

import numpy as np
import pytest

from surfsup.scene import InitialParticles, Scene
from surfsup.splishsplash.compressed_start import CompressedStartWarning, expansion_warning, without_compression
from surfsup.splishsplash.solver import simulate


def start(x: float, y: float) -> tuple[InitialParticles, InitialParticles]:
    """A block at the distances x and y from two walls of a container of 0.6 m, far from all others; moved or not."""
    text = (
        "container: {size: [0.6, 0.6, 1]}\n"
        f"fluid: [{{block: {{min: [{x - 0.3}, {y - 0.3}, 0.3], max: [0.1, 0.1, 0.5]}}}}]"
    )
    scene = Scene.from_yaml(text, "test")
    lattice = scene.initial_particles(None)
    return lattice, without_compression(scene, None, lattice)


@pytest.mark.parametrize(("x", "y"), [(0.02, 0.02), (0.006, 0.1), (0.1, 0.1)])
def test_fluid_far_from_walls_stays_where_it_is(x, y):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lattice, same = start(x, y)
    assert same is lattice


def test_fluid_close_to_one_wall_is_moved_and_a_warning_says_so():
    with pytest.warns(CompressedStartWarning, match=r"it begins 30 mm from a wall, .* leave 34 mm"):
        lattice, apart = start(0.0, 0.2)
    moved = np.linalg.norm(apart.positions - lattice.positions, axis=1)
    assert 0.001 < moved.max() < 0.03


def test_fluid_in_a_corner_needs_a_larger_distance():
    with pytest.warns(CompressedStartWarning, match=r"it begins 36 mm from several walls, .* leave 49 mm"):
        start(0.006, 0.006)


def test_the_reference_lets_a_dam_break_that_fills_its_channel_fall_quietly():
    block = "fluid: [{block: {min: [-0.3, -0.12, 0], max: [0, 0.12, 0.3]}}]"
    scene = Scene.from_yaml(f"container: {{size: [0.6, 0.24, 0.6]}}\n{block}\nframes: 3", "test")
    lattice = scene.initial_particles(None)
    with pytest.warns(CompressedStartWarning):
        apart = without_compression(scene, None, lattice)
    speeds = [
        np.linalg.norm(list(simulate(scene, None, particles))[1][1], axis=1).max() for particles in (lattice, apart)
    ]
    assert speeds[0] > 5
    assert speeds[1] < 1


@pytest.mark.parametrize(("x", "says"), [(0.0, "begins 30 mm from a wall, .* gains energy"), (0.1, None)])
def test_our_own_solver_warns_of_a_lattice_at_a_wall(x, says):
    block = f"fluid: [{{block: {{min: [{x - 0.3}, -0.1, 0.3], max: [0.1, 0.1, 0.5]}}}}]"
    scene = Scene.from_yaml(f"container: {{size: [0.6, 0.6, 1]}}\n{block}", "test")
    warning = expansion_warning(scene, scene.initial_particles(None))
    assert warning is None if says is None else re.search(says, warning or "")
