import numpy as np
import pytest
import torch

from surfsup.sph.state import ParticleState
from surfsup.training.config import Phase
from surfsup.training.objectives import Batch
from surfsup.training.run import TrainingRun
from tests.training.conftest import batch_of, config, generators


@pytest.fixture
def run(tmp_path) -> TrainingRun:
    return TrainingRun(config(), tmp_path)


@pytest.fixture
def state(run, data) -> ParticleState:
    return run.model.state_from_frames(*batch_of(run, data).windows[0].history)


def test_every_window_of_a_batch_counts(run, data):
    windows = batch_of(run, data).windows
    quiet = Phase(until=1, noise=0)
    together, rows = run.objective(Batch(windows, generators()), quiet)
    apart = [run.objective(Batch([window], generators()[:1]), quiet) for window in windows]
    torch.testing.assert_close(together, torch.stack([loss for loss, _ in apart]).mean())
    torch.testing.assert_close(rows, torch.cat([row for _, row in apart]), equal_nan=True)
    torch.testing.assert_close(rows[:, 0].mean(), together)
    assert not rows.requires_grad


def test_the_small_error_term_has_the_weight_of_the_phase(run, data):
    windows = batch_of(run, data).windows
    without, once, twice = (
        run.objective(Batch(windows, generators()), Phase(until=1, noise=0, small_errors=weight))[0]
        for weight in (0, 1, 2)
    )
    assert once > without
    torch.testing.assert_close(twice - without, 2 * (once - without))


def test_noise_is_added_to_a_copy_and_has_the_configured_size(run, state):
    random = np.random.default_rng(0)
    before = {name: value.clone() for name, value in vars(state).items()}
    noisy = run.objective.add_noise(state, 1e-3, random)
    assert 8e-4 < float((noisy.velocities - state.velocities).std()) * 0.005 < 1.2e-3
    assert all(torch.equal(value, before[name]) for name, value in vars(state).items())


def test_position_and_velocity_noise_are_correlated(run, state):
    noisy = run.objective.add_noise(state, 1e-3, np.random.default_rng(0))
    position = (noisy.positions - state.positions).flatten()
    velocity = (noisy.velocities - state.velocities).flatten() * 0.005
    # The position has 0.62 of the velocity noise and 0.5 of its own.
    assert 0.7 < torch.corrcoef(torch.stack([position, velocity]))[0, 1] < 0.85
