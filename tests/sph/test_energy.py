import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from surfsup import native
from surfsup.sph.energy import MAX_ENERGY_GAIN, energy_gain, limit_energy_gain
from surfsup.sph.environment import Environment
from surfsup.sph.solver import DfsphSolver
from surfsup.sph.state import WHOLE_FRAME, FramePart, ParticleState
from surfsup.sph.warp_engine import energy as in_warp

GRAVITY = torch.tensor([0.0, 0.0, -9.81])
NOTHING = Environment(None, torch.full((3,), -9.0), torch.full((3,), 9.0), GRAVITY)


def water(count: int = 50, seed: int = 0) -> ParticleState:
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random) * 0.3 + 0.5
    return ParticleState(positions, torch.randn(count, 3, generator=random))


def test_the_gain_of_a_case_computed_by_hand():
    state = ParticleState(torch.zeros(2, 3), torch.zeros(2, 3))
    positions = torch.tensor([[0.0, 0.0, 0.1], [0.0, 0.0, 0.0]])
    velocities = torch.tensor([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    assert math.isclose(energy_gain(state, positions, velocities, GRAVITY), (9.81 * 0.1 + 2.0) / 2, rel_tol=1e-6)


def test_cpp_and_torch_sum_the_same(monkeypatch):
    state = water(2000)
    after = state.positions + 0.01 * torch.randn(2000, 3), state.velocities + 0.1 * torch.randn(2000, 3)
    ours = energy_gain(state, *after, GRAVITY)
    monkeypatch.setattr("surfsup.sph.energy.can_run_native", lambda *_: False)
    assert math.isclose(ours, energy_gain(state, *after, GRAVITY), rel_tol=1e-4)
    assert energy_gain(ParticleState(*after), *after, GRAVITY) == 0


@pytest.mark.parametrize("seed", range(20))
def test_ballistic_motion_gains_nothing(seed):
    state = water(seed=seed)
    assert energy_gain(state, *state.ballistic(GRAVITY), GRAVITY) <= 1e-6


@pytest.fixture(params=["C++", "Warp"])
def limit(request, monkeypatch):
    """The limiter of each engine."""
    if request.param == "Warp":
        monkeypatch.setattr("surfsup.sph.energy.can_run_native", lambda *_: False)
    elif not native.instruction_sets():
        pytest.skip("the package was built without a compiler")
    return lambda state, positions, velocities: limit_energy_gain(state, positions, velocities, NOTHING)


def test_a_step_that_gains_nothing_does_not_change(limit):
    state = water()
    positions, velocities = state.ballistic(GRAVITY)
    slower = 0.9 * velocities
    found = limit(state, positions, slower)
    assert torch.equal(found[0], positions) and torch.equal(found[1], slower)


def test_a_thrown_particle_is_held_back_and_the_others_do_not_change(limit):
    state = water()
    positions, velocities = state.ballistic(GRAVITY)
    thrown = 0.99 * velocities
    thrown[7] += torch.tensor([0.0, 0.0, 30.0])
    new_positions, limited = limit(state, positions, thrown)
    assert energy_gain(state, new_positions, limited, GRAVITY) <= MAX_ENERGY_GAIN
    others = torch.arange(len(limited)) != 7
    torch.testing.assert_close(limited[others], thrown[others])
    assert (limited[7] - velocities[7]).norm() < 5


@pytest.mark.parametrize("count", [1, 50, 5000])
def test_deviations_that_all_add_energy_are_limited(limit, count):
    state = water(count)
    positions, velocities = state.ballistic(GRAVITY)
    new_positions, limited = limit(state, positions, 3 * velocities)
    assert energy_gain(state, new_positions, limited, GRAVITY) <= MAX_ENERGY_GAIN


def test_motion_is_ballistic_where_no_bound_suffices(limit):
    state = ParticleState(torch.zeros(4, 3), torch.tensor([3000.0, 0.0, 0.0]).repeat(4, 1))
    positions, velocities = state.ballistic(GRAVITY)
    found = limit(state, positions, velocities + torch.tensor([9.0, 0.0, 0.0]))
    torch.testing.assert_close(found, (positions, velocities), atol=1e-6, rtol=0)


@pytest.mark.skipif(not native.instruction_sets(), reason="the package was built without a compiler")
@given(
    seed=st.integers(0, 2**32 - 1),
    excess=st.floats(0, 40),
    part=st.sampled_from([WHOLE_FRAME, FramePart(0.002, 2)]),
    supplied=st.sampled_from([0.0, 0.1, 30.0]),
)
@settings(max_examples=20)
def test_cpp_and_warp_limit_alike(seed, excess, part, supplied):
    state = water(200, seed)
    positions, velocities = state.ballistic(GRAVITY, part)
    random = torch.Generator().manual_seed(seed)
    after = positions + 0.01 * torch.randn(200, 3, generator=random), velocities * (1 + excess)
    expected = limit_energy_gain(state, *after, NOTHING, part, supplied)
    found = in_warp.limit_energy_gain(state, *after, GRAVITY, part, supplied)
    torch.testing.assert_close(found, expected, atol=1e-5, rtol=1e-5)


def test_nan_stays_nan(limit):
    state = water()
    positions, velocities = state.ballistic(GRAVITY)
    velocities[3] = torch.nan
    _, limited = limit(state, positions, velocities)
    assert limited[3].isnan().all()


@pytest.mark.parametrize("faster", [0.9, 1.1, 3.0, 1e5])
def test_gradients_equal_finite_differences(faster):
    """With no bound, with bounds, and with ballistic motion."""
    state = water(12)
    values = [value.double() for value in (state.positions, state.velocities)]
    positions, velocities = ParticleState(*values).ballistic(GRAVITY.double())
    values = [value.requires_grad_() for value in (*values, positions + 0.001, faster * velocities)]

    def limited(*values: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return in_warp.limit_energy_gain(ParticleState(*values[:2]), *values[2:], GRAVITY.double())

    assert torch.autograd.gradcheck(limited, values, eps=1e-7, atol=1e-5)


@pytest.mark.parametrize("use_native", [True, False])
def test_no_state_makes_the_solver_gain_energy(use_native):
    """Random positions are far more compressed than water ever is: without the limiter they would burst."""
    environment = Environment(None, torch.full((3,), -9.0), torch.full((3,), 9.0), GRAVITY)
    solver = DfsphSolver()
    if not use_native:
        solver.native = None
    for seed in range(5):
        state = water(1200, seed)
        unlimited = solver.observe(state, environment)
        assert energy_gain(state, unlimited.positions, unlimited.velocities, GRAVITY) > MAX_ENERGY_GAIN
        for _ in range(5):
            after, _ = solver.step(state, environment)
            assert energy_gain(state, after.positions, after.velocities, GRAVITY) <= MAX_ENERGY_GAIN
            state = after
