import math

import pytest
import torch

from surfsup.learned.corrected.correction import Correction
from surfsup.learned.corrected.features import DISPLACEMENT_SCALE
from surfsup.learned.corrected.simulator import Architecture, CorrectedSimulator
from surfsup.sph.state import FRAME_TIME, Environment, ParticleState
from surfsup.training.objectives.correction_loss import CALM, RETURN, calm_loss, motion_loss, wanted_correction
from surfsup.training.objectives.strayed import FARTHEST, FASTEST

AROUND = Environment(
    None, torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0]), torch.tensor([0.0, 0.0, -9.81])
)
SURE = torch.ones(1)  # every particle is where the truth has it


def seen_by(simulator: CorrectedSimulator):
    """Particles so far apart that nothing acts: what is reached without the network is ballistic motion."""
    places = torch.cartesian_prod(*[0.1 * torch.arange(3)] * 3)[:20] + torch.tensor([0.0, 0.0, 0.5])
    return simulator.observe(ParticleState(places, torch.randn(20, 3)), AROUND)


def test_the_wanted_correction_leads_to_the_truth_and_costs_nothing():
    simulator = CorrectedSimulator(Architecture(width=4, layers=1))
    seen = seen_by(simulator)
    positions = seen.ahead + 1e-3 * torch.randn(20, 3)
    velocities = seen.state.velocities + torch.randn(20, 3)
    wanted = wanted_correction(seen, (seen.state.positions, seen.state.velocities), (positions, velocities))
    reached = simulator.advance(seen, wanted)
    torch.testing.assert_close(reached[0], positions, atol=1e-6, rtol=0)
    torch.testing.assert_close(reached[1], velocities, atol=1e-5, rtol=0)
    assert motion_loss(wanted, wanted, torch.zeros(20, dtype=torch.bool), SURE) == 0


def test_in_free_fall_nothing_is_wanted():
    seen = seen_by(CorrectedSimulator(Architecture(width=4, layers=1)))
    now = seen.state.positions, seen.state.velocities
    wanted = wanted_correction(seen, now, (seen.ahead, seen.state.velocities + FRAME_TIME * AROUND.gravity))
    assert wanted.velocity.abs().max() < 1e-4
    assert (wanted.position == 0).all()


def test_a_state_that_strayed_is_asked_back_by_a_part_only():
    seen = seen_by(CorrectedSimulator(Architecture(width=4, layers=1)))
    strayed, off = 3e-4 * torch.randn(20, 3), 0.05 * torch.randn(20, 3)
    before = seen.state.positions - strayed, seen.state.velocities - off
    after = seen.ahead - strayed, before[1] + FRAME_TIME * AROUND.gravity
    wanted = wanted_correction(seen, before, after)
    torch.testing.assert_close(wanted.position * DISPLACEMENT_SCALE, -RETURN * strayed, atol=1e-6, rtol=0)
    torch.testing.assert_close(wanted.velocity * DISPLACEMENT_SCALE / FRAME_TIME, -off, atol=1e-5, rtol=0)


def test_a_state_that_strayed_far_is_asked_no_more_than_one_that_strayed_a_little():
    seen = seen_by(CorrectedSimulator(Architecture(width=4, layers=1)))
    direction = torch.nn.functional.normalize(torch.randn(20, 3), dim=-1)
    before = seen.state.positions - 0.05 * direction, seen.state.velocities - 4 * direction
    after = seen.ahead - 0.05 * direction, before[1] + FRAME_TIME * AROUND.gravity
    wanted = wanted_correction(seen, before, after)
    asked = wanted.position * DISPLACEMENT_SCALE, wanted.velocity * DISPLACEMENT_SCALE / FRAME_TIME
    torch.testing.assert_close(asked[0], -RETURN * FARTHEST * direction, atol=1e-6, rtol=0)
    torch.testing.assert_close(asked[1], -FASTEST * direction, atol=1e-5, rtol=0)


def test_a_frame_cannot_look_easier_by_straying_in_the_one_before():
    strayed = torch.randn(5, 3, requires_grad=True)
    wanted = Correction(strayed, torch.zeros(5, 3))
    predicted = Correction(strayed, torch.zeros(5, 3))  # follows exactly: nothing may push it either way
    loss = motion_loss(predicted, wanted, torch.zeros(5, dtype=torch.bool), SURE)
    (gradient,) = torch.autograd.grad(loss, strayed)
    assert not gradient.any()


def test_motion_loss_worked_by_hand():
    nothing = Correction(torch.zeros(2, 3), torch.zeros(2, 3))
    wanted = Correction(torch.tensor([[1.0, 0, 0], [0, 0, 0]]), torch.tensor([[0, 2.0, 0], [0, 0, 0]]))
    far, near = torch.tensor([False, False]), torch.tensor([True, False])
    size = math.sqrt(0.5 + 0.05)  # the mean of 1 and 0, and the floor
    # Velocity 1² and twice position 2² make 9 for the first particle and 0 for the second.
    assert float(motion_loss(nothing, wanted, far, SURE)) == pytest.approx((9 + 0) / 2 / size)
    assert float(motion_loss(nothing, wanted, near, SURE)) == pytest.approx((2 * 9 + 0) / 3 / size)
    half = torch.tensor([0.5, 1.0])  # the first has strayed: its error counts half, and that of the frame with it
    assert float(motion_loss(nothing, wanted, near, half)) == pytest.approx((2 * 0.5 * 9 + 0) / 3 / size)


def test_calm_loss_worked_by_hand():
    nothing = Correction(torch.zeros(2, 3), torch.zeros(2, 3))
    # The first is off by CALM in its velocity, the second not at all: ln 2 and 0.
    wanted = Correction(torch.tensor([[CALM, 0, 0], [0, 0, 0]]), torch.zeros(2, 3))
    assert float(calm_loss(nothing, wanted, SURE)) == pytest.approx(math.log(2) / 2)


def test_halving_an_error_is_worth_the_same_to_the_calm_loss_whether_it_is_large_or_small():
    def gain(size: float) -> float:
        wanted = Correction(torch.full((5, 3), size), torch.full((5, 3), size))
        off, half = (Correction(share * wanted.velocity, share * wanted.position) for share in (0, 0.5))
        return float(calm_loss(off, wanted, SURE) - calm_loss(half, wanted, SURE))

    assert gain(100.0) == pytest.approx(math.log(4), rel=1e-3)
    assert gain(30 * CALM) == pytest.approx(math.log(4), rel=2e-3)
    assert gain(CALM / 100) < 1e-2


def test_losses_have_the_gradients_of_finite_differences():
    random = torch.Generator().manual_seed(0)

    def draw() -> torch.Tensor:
        return torch.randn(6, 3, generator=random, dtype=torch.float64)

    wanted, near = Correction(draw(), draw()), torch.tensor([True, False] * 3)
    predicted = draw().requires_grad_(), draw().requires_grad_()
    assert torch.autograd.gradcheck(lambda v, x: motion_loss(Correction(v, x), wanted, near, SURE), predicted)
    assert torch.autograd.gradcheck(lambda v, x: calm_loss(Correction(v, x), wanted, SURE), predicted)
