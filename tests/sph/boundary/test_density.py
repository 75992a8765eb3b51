import numpy as np
import pytest
import torch

from surfsup.sph.boundary.density import DISTANCE_OFFSET, MIN_DISTANCE, VOLUME_FACTOR, plane_fraction, solid_density
from surfsup.sph.boundary.volume_map import extension
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT, cubic_spline


def plane_density(distance: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    return solid_density(distance, plane_fraction(distance))


@pytest.mark.parametrize("distance", [0.0, 0.01, 0.02, 0.03, 0.04])
def test_a_plane_has_the_density_of_its_volume_map(distance):
    side = KERNEL_SUPPORT * ((np.arange(120) + 0.5) / 60 - 1)
    x, y, z = np.meshgrid(side, side, side, indexing="ij")
    fraction = extension(distance + z[x**2 + y**2 + z**2 < KERNEL_SUPPORT**2])
    volume = VOLUME_FACTOR * fraction.sum() * (KERNEL_SUPPORT / 60) ** 3
    kernel = KERNEL_PEAK * cubic_spline(np.array(max(distance + DISTANCE_OFFSET, MIN_DISTANCE) / KERNEL_SUPPORT))
    density = volume * kernel
    assert plane_density(torch.tensor(distance, dtype=torch.float64))[0] == pytest.approx(density, rel=2e-3)


@pytest.mark.parametrize("distance", [KERNEL_SUPPORT, 0.1, 5.0, torch.inf])
def test_beyond_the_kernel_support_density_is_zero(distance):
    density, slope = plane_density(torch.tensor([distance]))
    assert (density, slope) == (0, 0)


def test_density_increases_towards_the_solid():
    distance = torch.linspace(-0.03, KERNEL_SUPPORT, 500, dtype=torch.float64)
    density, slope = plane_density(distance)
    assert (density.diff() <= 0).all()
    assert (slope[:-1] >= 0).all()


def test_a_lone_particle_rests_almost_a_spacing_from_a_plane():
    """There its self density 1 / pi and the density of the solid add up to one."""
    distance = torch.linspace(0.0, KERNEL_SUPPORT, 6001, dtype=torch.float64)
    rest = distance[(1 / torch.pi + plane_density(distance)[0]) <= 1][0]
    assert rest == pytest.approx(0.0262, abs=5e-4)


@pytest.mark.parametrize("distance", [0.0253, 0.0301, 0.0456])
def test_the_slope_is_the_derivative_at_constant_volume_fraction(distance):
    """As in the reference, whose map has no derivative of the volume fraction."""
    position, fraction = torch.tensor(distance, dtype=torch.float64), torch.tensor(0.4, dtype=torch.float64)
    step = 1e-5
    increase = solid_density(position - step, fraction)[0] - solid_density(position + step, fraction)[0]
    torch.testing.assert_close(
        solid_density(position, fraction)[1], increase / (2 * step) * KERNEL_SUPPORT, rtol=1e-4, atol=0
    )


def test_gradients_equal_finite_differences():
    distance = torch.tensor([-0.01003, 0.02003, 0.04507], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda d: plane_density(d)[0], distance, eps=1e-7)


def test_nan_stays_nan():
    density, slope = plane_density(torch.tensor([torch.nan, 0.02]))
    assert density.isnan().tolist() == slope.isnan().tolist() == [True, False]
