import torch

from surfsup.datasets.density import number_density
from surfsup.model.neighbours import neighbourhood
from surfsup.scene import SPACING
from surfsup.training.objectives.density_loss import SQUEEZED, density_loss, lattice_density


def lattice(count: int, spacing: float = SPACING) -> torch.Tensor:
    return torch.cartesian_prod(*[spacing * torch.arange(count, dtype=torch.float64)] * 3)


def test_density_is_that_of_the_data_sets_checks():
    positions = 0.15 * torch.rand(200, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    near = neighbourhood(positions.float(), 0.061)
    apart = positions[near.senders] - positions[near.receivers]
    ours = lattice_density(apart.square().sum(dim=-1), near)
    torch.testing.assert_close(ours, torch.from_numpy(number_density(positions.T.numpy())), rtol=1e-6, atol=1e-6)


def test_water_on_its_lattice_or_thinner_costs_nothing():
    for spacing in (SPACING, 1.1 * SPACING):
        positions = lattice(5, spacing)
        assert density_loss(positions, neighbourhood(positions.float(), 0.061)) < 1e-3


def test_squeezed_water_costs_the_square_of_its_excess():
    positions = lattice(5, 0.95 * SPACING)
    dense = torch.from_numpy(number_density(positions.T.numpy()))
    expected = ((dense - 1).clamp(min=0) / SQUEEZED).square().mean()
    assert expected > 1
    loss = density_loss(positions, neighbourhood(positions.float(), 0.061))
    torch.testing.assert_close(loss, expected, rtol=1e-6, atol=0)


def test_the_density_loss_has_the_gradients_of_finite_differences_even_where_particles_meet():
    positions = lattice(2, 0.02) + 1e-3 * torch.randn(8, 3, generator=torch.Generator().manual_seed(0)).double()
    near = neighbourhood(positions.float(), 0.061)
    positions = positions.detach().requires_grad_()
    assert torch.autograd.gradcheck(lambda places: density_loss(places, near), positions)
    together = torch.zeros(20, 3, requires_grad=True)
    density_loss(together, neighbourhood(together.detach(), 0.061)).backward()
    assert torch.isfinite(together.grad).all()
