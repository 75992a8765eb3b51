import pytest
import torch

from surfsup.sdf import Sphere
from surfsup.sph.collision import CLEARANCE
from surfsup.sph.environment import Environment
from surfsup.training.objectives.outside_target import outside_target

STEP = 1.5e-3
BALL = Sphere(0.2)


def environment(surface=BALL) -> Environment:
    return Environment(surface, torch.tensor([-0.5] * 3), torch.tensor([0.5] * 3), torch.zeros(3))


def at(*x: float) -> torch.Tensor:
    return torch.tensor([[value, 0.0, 0.0] for value in x])


@pytest.mark.parametrize("surface", [BALL, None])
def test_a_target_with_clearance_is_unchanged(surface):
    target = at(0.2 + CLEARANCE + 1e-4, 0.3, 0.5 - CLEARANCE - 1e-4)
    assert torch.equal(outside_target(target - 0.001, target, STEP, environment(surface)), target)


def test_a_target_that_is_too_near_moves_to_the_clearance():
    start, target = at(0.225, 0.475), at(0.19, 0.51)
    expected = at(0.2 + CLEARANCE, 0.5 - CLEARANCE)
    torch.testing.assert_close(outside_target(start, target, STEP, environment()), expected)


def test_particles_inside_move_out_by_a_step():
    start = at(0.17, 0.52, -0.52)
    expected = at(0.17 + STEP, 0.52 - STEP, -0.52 + STEP)
    torch.testing.assert_close(outside_target(start, start, STEP, environment()), expected)


def test_a_particle_inside_may_move_out_faster():
    start, target = at(0.17, 0.52), at(0.18, 0.51)
    assert torch.equal(outside_target(start, target, STEP, environment()), target)


def test_the_target_along_a_wall_stays():
    start, target = torch.tensor([[0.52, 0.1, 0.2]]), torch.tensor([[0.53, 0.11, 0.23]])
    expected = torch.tensor([[0.52 - STEP, 0.11, 0.23]])
    torch.testing.assert_close(outside_target(start, target, STEP, environment()), expected)
