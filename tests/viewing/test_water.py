from pathlib import Path

import numpy as np
import pytest

from surfsup.errors import SimulationError
from surfsup.viewing.water import water_surface

RADIUS = 0.015
# Particles of a frame of a falling block (x, y, z, meters, float32) around which pysplashsurf 0.14
# loses a vertex, on a grid of 0.7 radii.
UNLUCKY = np.load(Path(__file__).with_name("unlucky_particles.npy"), allow_pickle=False)


def test_particles_that_the_library_stumbles_over_have_a_surface_too(off_screen):
    surface = water_surface(UNLUCKY, RADIUS)
    assert surface.n_points > 1000 and surface.is_manifold
    for axis in range(3):
        low, high = surface.bounds[2 * axis : 2 * axis + 2]
        assert UNLUCKY[:, axis].min() - 2 * RADIUS < low and high < UNLUCKY[:, axis].max() + 2 * RADIUS


def test_where_there_is_no_surface_it_says_so(off_screen):
    with pytest.raises(SimulationError, match="no surface around the 1 particles"):
        water_surface(np.full((1, 3), np.nan, np.float32), RADIUS)
