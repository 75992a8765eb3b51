import numpy as np
import pytest
import torch

from surfsup.sph.boundary.density import NEAREST, OFFSET, VOLUME_FACTOR, flat_share, solid_density
from surfsup.sph.boundary.volume_map import extension
from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT, cubic_spline


def flat_density(distance: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    return solid_density(distance, flat_share(distance))


@pytest.mark.parametrize("distance", [0.0, 0.01, 0.02, 0.03, 0.04])
def test_it_is_what_the_solver_makes_of_a_flat_solid_and_its_volume_map(distance):
    side = KERNEL_SUPPORT * ((np.arange(120) + 0.5) / 60 - 1)
    x, y, z = np.meshgrid(side, side, side, indexing="ij")
    share = extension(distance + z[x**2 + y**2 + z**2 < KERNEL_SUPPORT**2])
    volume = VOLUME_FACTOR * share.sum() * (KERNEL_SUPPORT / 60) ** 3
    kernel = KERNEL_PEAK * cubic_spline(np.array(max(distance + OFFSET, NEAREST) / KERNEL_SUPPORT))
    density = volume * kernel
    assert flat_density(torch.tensor(distance, dtype=torch.float64))[0] == pytest.approx(density, rel=2e-3)


@pytest.mark.parametrize("distance", [KERNEL_SUPPORT, 0.1, 5.0, torch.inf])
def test_beyond_the_support_nothing_is_felt(distance):
    density, slope = flat_density(torch.tensor([distance]))
    assert (density, slope) == (0, 0)


def test_the_nearer_the_denser():
    distance = torch.linspace(-0.03, KERNEL_SUPPORT, 500, dtype=torch.float64)
    density, slope = flat_density(distance)
    assert (density.diff() <= 0).all()
    assert (slope[:-1] >= 0).all()


def test_a_particle_alone_is_kept_a_spacing_from_a_flat_solid():
    """There its own density, 1 / pi of the lattice's, and the solid's come to one."""
    distance = torch.linspace(0.0, KERNEL_SUPPORT, 6001, dtype=torch.float64)
    kept = distance[(1 / torch.pi + flat_density(distance)[0]) <= 1][0]
    assert kept == pytest.approx(0.0262, abs=5e-4)


@pytest.mark.parametrize("distance", [0.0253, 0.0301, 0.0456])
def test_the_rise_is_that_of_the_density_at_the_same_share(distance):
    """So the solver has it, whose map says nothing of how the share changes."""
    place, share = torch.tensor(distance, dtype=torch.float64), torch.tensor(0.4, dtype=torch.float64)
    step = 1e-5
    fall = solid_density(place - step, share)[0] - solid_density(place + step, share)[0]
    torch.testing.assert_close(solid_density(place, share)[1], fall / (2 * step) * KERNEL_SUPPORT, rtol=1e-4, atol=0)


def test_it_has_gradients_in_the_distance():
    distance = torch.tensor([-0.01003, 0.02003, 0.04507], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda d: flat_density(d)[0], distance, eps=1e-7)


def test_what_is_no_number_stays_none():
    density, slope = flat_density(torch.tensor([torch.nan, 0.02]))
    assert density.isnan().tolist() == slope.isnan().tolist() == [True, False]
