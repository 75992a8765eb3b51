from pathlib import Path

import numpy as np
import pytest

from surfsup.errors import SimulationError
from surfsup.viewing.water import reconstruct_surface

RADIUS = 0.015
# Positions (N, 3) of a frame of a falling block, meters, float32.
# With a cell size of 0.7 particle radii pysplashsurf 0.14 loses a vertex around them.
UNLUCKY = np.load(Path(__file__).with_name("unlucky_particles.npy"), allow_pickle=False)


def test_a_failed_reconstruction_is_repeated_with_another_cell_size(off_screen):
    surface = reconstruct_surface(UNLUCKY, RADIUS)
    assert surface.n_points > 1000 and surface.is_manifold
    for axis in range(3):
        low, high = surface.bounds[2 * axis : 2 * axis + 2]
        assert UNLUCKY[:, axis].min() - 2 * RADIUS < low and high < UNLUCKY[:, axis].max() + 2 * RADIUS


def test_particles_without_a_surface_are_an_error(off_screen):
    with pytest.raises(SimulationError, match="no surface around the 1 particles"):
        reconstruct_surface(np.full((1, 3), np.nan, np.float32), RADIUS)
