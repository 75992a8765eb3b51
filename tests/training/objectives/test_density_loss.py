import torch

from surfsup.datasets.density import number_density
from surfsup.scene import SPACING
from surfsup.sdf import Sphere
from surfsup.sph.boundary.density import plane_fraction, solid_density
from surfsup.sph.environment import Environment
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.training.objectives.density_loss import COMPRESSION_SCALE, density_loss, fluid_density

FAR = Environment(None, torch.tensor([-5.0, -5.0, -5.0]), torch.tensor([5.0, 5.0, 5.0]), torch.zeros(3))


def loss_of(positions: torch.Tensor, environment: Environment = FAR) -> torch.Tensor:
    neighbors = find_neighbors(positions.detach().float(), 0.061)
    return density_loss(positions, neighbors, environment.distance_and_normal(positions)[0], environment)


def lattice(count: int, spacing: float = SPACING) -> torch.Tensor:
    return torch.cartesian_prod(*[spacing * torch.arange(count, dtype=torch.float64)] * 3)


def test_the_density_equals_that_of_the_checks_of_data_sets():
    positions = 0.15 * torch.rand(200, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    neighbors = find_neighbors(positions.float(), 0.061)
    offsets = positions[neighbors.senders] - positions[neighbors.receivers]
    density = fluid_density(offsets.square().sum(dim=-1), neighbors)
    torch.testing.assert_close(density, torch.from_numpy(number_density(positions.T.numpy())), rtol=1e-6, atol=1e-6)


def test_fluid_at_or_below_the_rest_density_has_no_loss():
    for spacing in (SPACING, 1.1 * SPACING):
        positions = lattice(5, spacing)
        assert loss_of(positions) < 1e-3


def test_the_loss_of_compressed_fluid_is_the_square_of_its_excess():
    positions = lattice(5, 0.95 * SPACING)
    density = torch.from_numpy(number_density(positions.T.numpy()))
    expected = ((density - 1).clamp(min=0) / COMPRESSION_SCALE).square().mean()
    assert expected > 1
    loss = loss_of(positions)
    torch.testing.assert_close(loss, expected, rtol=1e-6, atol=0)


def test_the_loss_has_the_gradients_of_finite_differences_and_finite_ones_where_particles_coincide():
    positions = lattice(2, 0.02) + 1e-3 * torch.randn(8, 3, generator=torch.Generator().manual_seed(0)).double()
    positions = positions.detach().requires_grad_()
    assert torch.autograd.gradcheck(loss_of, positions)
    together = torch.zeros(20, 3, requires_grad=True)
    loss_of(together).backward()
    assert torch.isfinite(together.grad).all()


def test_solids_and_walls_add_to_the_density():
    one = torch.tensor([[0.0, 0.0, 0.32]], dtype=torch.float64)
    beside_a_ball = Environment(Sphere(0.3), FAR.lower, FAR.upper, FAR.gravity)
    on_the_floor = Environment(None, torch.tensor([-5.0, -5.0, 0.3]), FAR.upper, FAR.gravity)
    distance = torch.tensor(0.02, dtype=torch.float64)
    added = solid_density(distance, plane_fraction(distance))[0]
    for environment in (beside_a_ball, on_the_floor):
        expected = ((1 / torch.pi + added - 1) / COMPRESSION_SCALE).square()
        torch.testing.assert_close(loss_of(one, environment), expected, rtol=1e-4, atol=0)
    assert loss_of(one) == 0
