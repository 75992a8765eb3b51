import numpy as np
import pytest

from surfsup.datasets.density import number_density
from surfsup.scene import SPACING


def lattice(count: int) -> np.ndarray:
    return SPACING * np.stack(np.meshgrid(*[np.arange(count)] * 3, indexing="ij")).reshape(3, -1).astype(float)


def test_density_is_one_inside_the_lattice_and_less_at_its_faces():
    density = number_density(lattice(7)).reshape(7, 7, 7)
    assert density[3, 3, 3] == pytest.approx(1, abs=1e-3)
    assert density[0, 3, 3] < 0.9 * density[3, 3, 3]
    assert density.max() == pytest.approx(density[3, 3, 3])


def test_density_is_inversely_proportional_to_the_cube_of_the_spacing():
    assert number_density(0.95 * lattice(7)).max() == pytest.approx(0.95**-3, rel=0.01)


def test_a_single_particle_has_the_kernels_peak():
    alone = number_density(np.zeros((3, 1)))
    np.testing.assert_allclose(alone, 8 / (np.pi * 8))
