import pytest
import torch

from surfsup.model.features import DISPLACEMENT_SCALE
from surfsup.model.state import Surroundings
from surfsup.scene import SURFACE_CLEARANCE, WALL_CLEARANCE
from surfsup.sdf import Sphere
from surfsup.training.objectives.clearance_loss import clearance_loss

RADIUS = 0.2


def around(solid: bool = True) -> Surroundings:
    corner = torch.tensor([0.5, 0.5, 0.5], dtype=torch.float64)
    gravity = torch.tensor([0.0, 0.0, -9.81], dtype=torch.float64)
    return Surroundings(Sphere(RADIUS).double() if solid else None, -corner, corner, gravity)


def at(*places: tuple[float, float, float]) -> torch.Tensor:
    return torch.tensor(places, dtype=torch.float64)


def test_what_keeps_its_distance_costs_nothing():
    clear = at((RADIUS + 1.001 * SURFACE_CLEARANCE, 0, 0), (0, 0.4999 - WALL_CLEARANCE, 0))
    assert clearance_loss(clear, around()) == 0
    assert clearance_loss(at((0, 0, 0)), around(solid=False)) == 0


@pytest.mark.parametrize(
    ("place", "direction"),
    [((0, 0, RADIUS + SURFACE_CLEARANCE - 1e-3), (0, 0, -1)), ((0.5 - WALL_CLEARANCE + 1e-3, 0, 0), (1, 0, 0))],
)
def test_a_millimetre_too_near_costs_its_length_and_pulls_back(place, direction):
    positions = at(place, (0.35, 0.35, 0.35)).requires_grad_()
    loss = clearance_loss(positions, around())
    assert loss.item() == pytest.approx(1e-3 / DISPLACEMENT_SCALE / 2, rel=1e-5)
    loss.backward()
    expected = at(direction, (0, 0, 0)) / DISPLACEMENT_SCALE / 2
    torch.testing.assert_close(positions.grad, expected)


def test_has_the_gradients_of_finite_differences():
    random = torch.Generator().manual_seed(0)
    turned = torch.nn.functional.normalize(torch.randn(20, 3, generator=random, dtype=torch.float64), dim=-1)
    positions = ((RADIUS + 0.5 * SURFACE_CLEARANCE) * turned).requires_grad_()
    assert torch.autograd.gradcheck(lambda places: clearance_loss(places, around()), positions)
