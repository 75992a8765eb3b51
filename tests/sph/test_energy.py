import math

import pytest
import torch

from surfsup import native
from surfsup.learned.corrected.simulator import Architecture, CorrectedSimulator
from surfsup.sph.energy import GAIN, energy_gain, without_gain
from surfsup.sph.state import Environment, ParticleState

GRAVITY = torch.tensor([0.0, 0.0, -9.81])


def water(count: int = 50, seed: int = 0) -> ParticleState:
    random = torch.Generator().manual_seed(seed)
    positions = torch.rand(count, 3, generator=random) * 0.3 + 0.5
    velocities = torch.randn(count, 3, generator=random)
    return ParticleState(positions, velocities)


def test_the_gain_of_a_hand_worked_case():
    state = ParticleState(torch.zeros(2, 3), torch.zeros(2, 3))
    higher = torch.tensor([[0.0, 0.0, 0.1], [0.0, 0.0, 0.0]])
    faster = torch.tensor([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    assert math.isclose(energy_gain(state, higher, faster, GRAVITY), (9.81 * 0.1 + 2.0) / 2, rel_tol=1e-6)


def test_torch_adds_up_the_same(monkeypatch):
    state = water(2000)
    after = state.positions + 0.01 * torch.randn(2000, 3), state.velocities + 0.1 * torch.randn(2000, 3)
    ours = energy_gain(state, *after, GRAVITY)
    monkeypatch.setattr(native, "instruction_sets", list)
    assert math.isclose(ours, energy_gain(state, *after, GRAVITY), rel_tol=1e-4)
    assert energy_gain(state.moved_to(*after), *after, GRAVITY) == 0


def test_ballistic_motion_gains_nothing_however_it_moves():
    for seed in range(20):
        state = water(seed=seed)
        assert energy_gain(state, *state.ballistic(GRAVITY), GRAVITY) <= 1e-6


def test_a_step_that_gains_nothing_is_left_as_it_is():
    state = water()
    positions, velocities = state.ballistic(GRAVITY)
    slower = 0.9 * velocities
    assert without_gain(state, positions, slower, GRAVITY) == (positions, slower)


def test_the_particle_that_is_thrown_is_held_back_and_the_others_keep_their_corrections():
    state = water()
    positions, velocities = state.ballistic(GRAVITY)
    wanted = 0.99 * velocities
    wanted[7] += torch.tensor([0.0, 0.0, 30.0])
    kept_positions, kept = without_gain(state, positions, wanted, GRAVITY)
    assert energy_gain(state, kept_positions, kept, GRAVITY) <= GAIN
    others = torch.arange(len(kept)) != 7
    torch.testing.assert_close(kept[others], wanted[others])
    assert (kept[7] - velocities[7]).norm() < 5


def test_where_every_correction_adds_energy_little_of_them_is_left():
    state = water()
    positions, velocities = state.ballistic(GRAVITY)
    kept_positions, kept = without_gain(state, positions, 3 * velocities, GRAVITY)
    assert energy_gain(state, kept_positions, kept, GRAVITY) <= GAIN


def test_what_is_no_number_stays_so():
    state = water()
    positions, velocities = state.ballistic(GRAVITY)
    velocities[3] = torch.nan
    _, kept = without_gain(state, positions, velocities, GRAVITY)
    assert kept[3].isnan().all()


@torch.no_grad()
@pytest.mark.parametrize("recording", [True, False])
def test_no_weights_whatever_make_the_water_gain_energy(recording, monkeypatch):
    would_gain = []

    def counted(*step: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        would_gain.append(energy_gain(*step))
        return without_gain(*step)

    monkeypatch.setattr("surfsup.learned.corrected.simulator.without_gain", counted)
    environment = Environment(None, torch.tensor([-9.0, -9.0, -9.0]), torch.tensor([9.0, 9.0, 9.0]), GRAVITY)
    for seed in range(5):
        torch.manual_seed(seed)
        simulator = CorrectedSimulator(Architecture(width=8, layers=2))
        torch.nn.init.normal_(simulator.network.decoder[-1].weight, std=100.0)
        state = water(800, seed)
        for _ in range(5):
            with torch.set_grad_enabled(recording):  # without gradients the native step does it
                after, _ = simulator.step(state, environment)
            after = after.detach()
            assert energy_gain(state, after.positions, after.velocities, GRAVITY) <= GAIN
            state = after
    assert max(would_gain) > 100 * GAIN
