import math

import pytest
import torch

from surfsup.learned.corrected.correction import Correction
from surfsup.learned.corrected.features import DISPLACEMENT_SCALE
from surfsup.scene import FRAME_TIME
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver, Observation
from surfsup.sph.state import ParticleState
from surfsup.training.objectives.correction_loss import (
    POSITION_RETURN,
    correction_loss,
    target_correction,
)
from surfsup.training.objectives.drift import MAX_POSITION_DRIFT, MAX_VELOCITY_DRIFT

ENVIRONMENT = Environment(
    None, torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0]), torch.tensor([0.0, 0.0, -9.81])
)
FULL = torch.ones(1)  # the weight of particles without drift


@pytest.fixture
def observation() -> Observation:
    """Particles without neighbors: the solver moves them ballistically."""
    positions = torch.cartesian_prod(*[0.1 * torch.arange(3)] * 3)[:20] + torch.tensor([0.0, 0.0, 0.5])
    return DfsphSolver().observe(ParticleState(positions, torch.randn(20, 3)), ENVIRONMENT)


def test_the_target_leads_to_the_truth_and_has_no_loss(observation):
    positions = observation.positions + 1e-3 * torch.randn(20, 3)
    velocities = observation.state.velocities + torch.randn(20, 3)
    before = observation.state.positions, observation.state.velocities
    target = target_correction(observation, before, (positions, velocities))
    reached = target.added_to(observation.positions, observation.velocities)
    torch.testing.assert_close(reached[0], positions, atol=1e-6, rtol=0)
    torch.testing.assert_close(reached[1], velocities, atol=1e-5, rtol=0)
    assert correction_loss(target, target, torch.zeros(20, dtype=torch.bool), FULL) == 0


def test_the_target_in_free_fall_is_zero(observation):
    before = observation.state.positions, observation.state.velocities
    after = observation.positions, observation.state.velocities + FRAME_TIME * ENVIRONMENT.gravity
    target = target_correction(observation, before, after)
    assert target.velocity.abs().max() < 1e-4
    assert (target.position == 0).all()


def test_the_target_corrects_a_share_of_a_position_drift_and_all_of_a_velocity_drift(observation):
    position_drift, velocity_drift = 3e-4 * torch.randn(20, 3), 0.05 * torch.randn(20, 3)
    before = observation.state.positions - position_drift, observation.state.velocities - velocity_drift
    after = observation.positions - position_drift, before[1] + FRAME_TIME * ENVIRONMENT.gravity
    target = target_correction(observation, before, after)
    torch.testing.assert_close(
        target.position * DISPLACEMENT_SCALE, -POSITION_RETURN * position_drift, atol=1e-6, rtol=0
    )
    torch.testing.assert_close(target.velocity * DISPLACEMENT_SCALE / FRAME_TIME, -velocity_drift, atol=1e-5, rtol=0)


def test_the_target_corrects_a_large_drift_no_more_than_one_at_the_bounds(observation):
    direction = torch.nn.functional.normalize(torch.randn(20, 3), dim=-1)
    before = observation.state.positions - 0.05 * direction, observation.state.velocities - 4 * direction
    after = observation.positions - 0.05 * direction, before[1] + FRAME_TIME * ENVIRONMENT.gravity
    target = target_correction(observation, before, after)
    position, velocity = target.position * DISPLACEMENT_SCALE, target.velocity * DISPLACEMENT_SCALE / FRAME_TIME
    torch.testing.assert_close(position, -POSITION_RETURN * MAX_POSITION_DRIFT * direction, atol=1e-6, rtol=0)
    torch.testing.assert_close(velocity, -MAX_VELOCITY_DRIFT * direction, atol=1e-5, rtol=0)


def test_the_size_of_the_target_has_no_gradient():
    """Otherwise a larger drift in the frame before would lower the loss."""
    drift = torch.randn(5, 3, requires_grad=True)
    target = Correction(drift, torch.zeros(5, 3))
    predicted = Correction(drift, torch.zeros(5, 3))  # equals the target for any drift
    loss = correction_loss(predicted, target, torch.zeros(5, dtype=torch.bool), FULL)
    (gradient,) = torch.autograd.grad(loss, drift)
    assert not gradient.any()


def test_the_correction_loss_of_two_particles():
    zero = Correction(torch.zeros(2, 3), torch.zeros(2, 3))
    target = Correction(torch.tensor([[1.0, 0, 0], [0, 0, 0]]), torch.tensor([[0, 2.0, 0], [0, 0, 0]]))
    far, near = torch.tensor([False, False]), torch.tensor([True, False])
    size = math.sqrt(0.5 + 0.05)  # the mean of 1 and 0, and the floor
    # Velocity 1² and twice position 2² make 9 for the first particle and 0 for the second.
    assert float(correction_loss(zero, target, far, FULL)) == pytest.approx((9 + 0) / 2 / size)
    assert float(correction_loss(zero, target, near, FULL)) == pytest.approx((2 * 9 + 0) / 3 / size)
    half = torch.tensor([0.5, 1.0])  # the first has drifted: its error has half the weight
    assert float(correction_loss(zero, target, near, half)) == pytest.approx((2 * 0.5 * 9 + 0) / 3 / size)


def test_the_loss_has_the_gradients_of_finite_differences():
    random = torch.Generator().manual_seed(0)

    def draw() -> torch.Tensor:
        return torch.randn(6, 3, generator=random, dtype=torch.float64)

    target, near = Correction(draw(), draw()), torch.tensor([True, False] * 3)
    predicted = draw().requires_grad_(), draw().requires_grad_()
    assert torch.autograd.gradcheck(lambda v, x: correction_loss(Correction(v, x), target, near, FULL), predicted)
