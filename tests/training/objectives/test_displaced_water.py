import numpy as np
import torch

from surfsup.learned.message_passing.history import History
from surfsup.sdf import Sphere
from surfsup.sph.environment import Environment
from surfsup.training.objectives.displaced_water import MAX_DEPTH, REACH, displace_water, nearest_boundary

ENVIRONMENT = Environment(Sphere(0.2), torch.tensor([-0.5] * 3), torch.tensor([0.5] * 3), torch.zeros(3))


def water(low: list[float], high: list[float]) -> History:
    """A lattice of particles at rest."""
    axes = [torch.arange(a, b, 0.03) for a, b in zip(low, high, strict=True)]
    positions = torch.cartesian_prod(*axes)
    return History(positions, torch.zeros_like(positions), torch.zeros(len(positions), 4, 3))


def test_the_nearest_boundary_is_the_solid_or_a_wall():
    points = torch.tensor([[0.0, 0.0, 0.24], [0.45, 0.0, 0.0], [0.0, -0.46, 0.1], [0.1, 0.2, 0.3]])
    inward, close = nearest_boundary(points, ENVIRONMENT)
    torch.testing.assert_close(inward[:3], torch.tensor([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]))
    assert close.tolist() == [True, True, True, False]


def test_without_a_solid_the_nearest_boundary_is_a_wall():
    environment = Environment(None, ENVIRONMENT.lower, ENVIRONMENT.upper, ENVIRONMENT.gravity)
    inward, close = nearest_boundary(torch.tensor([[0.0, 0.0, 0.1]]), environment)
    assert torch.equal(inward, torch.tensor([[0.0, 0.0, 1.0]]))
    assert not close.any()


def test_a_patch_of_water_moves_towards_the_boundary_and_the_rest_stays():
    state = water([-0.15, -0.15, 0.22], [0.15, 0.15, 0.4])
    inward, close = nearest_boundary(state.positions, ENVIRONMENT)
    random, displaced = np.random.default_rng(0), 0
    for _ in range(20):
        move = displace_water(state, ENVIRONMENT, random).positions - state.positions
        moved = move.norm(dim=-1) > 0
        assert 1 <= moved.sum() < close.sum()
        assert not (moved & ~close).any()
        depth = (move * inward).sum(dim=-1)[moved]
        torch.testing.assert_close(depth, depth[:1].expand_as(depth), atol=1e-6, rtol=0)
        assert depth[0] <= MAX_DEPTH
        displaced = max(displaced, float(depth[0]))
    assert displaced > REACH / 2, "some end inside"


def test_the_displacements_stay_and_the_same_generator_gives_the_same():
    state = water([-0.15, -0.15, 0.22], [0.15, 0.15, 0.4])
    one, same = (displace_water(state, ENVIRONMENT, np.random.default_rng(1)) for _ in range(2))
    assert torch.equal(one.positions, same.positions)
    assert one.displacements is state.displacements


def test_water_far_from_any_boundary_is_not_displaced():
    state = water([0.25, 0.25, 0.25], [0.35, 0.35, 0.35])
    assert displace_water(state, ENVIRONMENT, np.random.default_rng(0)) is state
