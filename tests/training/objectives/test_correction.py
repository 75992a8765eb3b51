import numpy as np
import pytest
import torch

from surfsup.training.config import Phase
from surfsup.training.objectives import Batch
from surfsup.training.objectives.correction import with_error
from surfsup.training.run import Run
from tests.training.conftest import batch_of, config, fresh


@pytest.fixture
def run(tmp_path) -> Run:
    return Run(config(), tmp_path)


def state_of(run, data):
    return run.model.state_after(*batch_of(run, data).windows[0].up_to_now)


def test_every_window_of_a_batch_counts(run, data):
    windows = batch_of(run, data).windows
    quiet = Phase(until=1, noise=0)
    together, rows = run.objective(Batch(windows, fresh()), quiet)
    apart = [run.objective(Batch([window], fresh()[:1]), quiet) for window in windows]
    torch.testing.assert_close(together, torch.stack([loss for loss, _ in apart]).mean())
    torch.testing.assert_close(rows, torch.cat([row for _, row in apart]), equal_nan=True)
    torch.testing.assert_close(rows[:, 0].mean(), together)
    assert not rows.requires_grad


def test_small_errors_cost_what_the_phase_weighs_them(run, data):
    windows = batch_of(run, data).windows
    plain, calm, calmer = (
        run.objective(Batch(windows, fresh()), Phase(until=1, noise=0, calm=weight))[0] for weight in (0, 1, 2)
    )
    assert calm > plain
    torch.testing.assert_close(calmer - plain, 2 * (calm - plain))


def test_noise_is_on_a_copy_and_never_larger_than_asked_for(run, data):
    random, state = np.random.default_rng(0), state_of(run, data)
    before = {name: value.clone() for name, value in vars(state).items()}
    assert with_error(state, 0, random) is state
    noisy = [with_error(state, 1e-3, random) for _ in range(200)]
    spreads = [float((one.velocities - state.velocities).std()) * 0.005 for one in noisy]
    assert min(spreads) < 2e-5
    assert 8e-4 < max(spreads) < 1.2e-3
    assert all(torch.equal(value, before[name]) for name, value in vars(state).items())


def test_noise_puts_off_places_with_velocities(run, data):
    state = state_of(run, data)
    noisy = with_error(state, 1e-3, np.random.default_rng(0))
    place, move = (noisy.positions - state.positions).flatten(), (noisy.velocities - state.velocities).flatten() * 0.005
    assert 0.7 < torch.corrcoef(torch.stack([place, move]))[0, 1] < 0.85  # 0.62 to 0.5 of another error
