import dataclasses

import numpy as np
import pytest
import torch

from surfsup.datasets.windows import Window, Windows
from surfsup.learned.message_passing.history import HISTORY_LENGTH, History
from surfsup.scene import FRAME_TIME, NEAR_SURFACE_DISTANCE
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.training.batches import NORMALIZATION_WINDOWS, fit_normalizers
from surfsup.training.config import Phase
from surfsup.training.objectives import Batch
from surfsup.training.objectives.acceleration import NEAR_WEIGHT, true_displacement
from surfsup.training.objectives.density_loss import density_loss
from surfsup.training.objectives.drift import MAX_VELOCITY_DRIFT
from surfsup.training.run import TrainingRun
from tests.training.conftest import MESSAGE_PASSING, batch_of, generators, message_passing

QUIET = Phase(until=1, noise=0)


@pytest.fixture
def run(tmp_path) -> TrainingRun:
    return TrainingRun(message_passing("surfsup"), tmp_path)


def state_of(run: TrainingRun, window: Window) -> History:
    return run.model.state_from_frames(*window.history)


def prediction(run: TrainingRun, state: History, window: Window) -> torch.Tensor:
    return run.model.predict_acceleration(run.model.network_input(state, window.environment))


def test_the_loss_is_the_weighted_squared_error_of_the_normalized_acceleration(run, data):
    (window, _), normalizer = batch_of(run, data).windows, run.model.acceleration_normalizer
    assert (window.history_length, window.frames_after) == (HISTORY_LENGTH, 1)
    loss, rows = run.objective(Batch([window], generators()[:1]), QUIET)
    # The same from the true frames, written out.
    positions = [window.frame(number)[0] for number in (-1, 0, 1)]
    acceleration = positions[2] - 2 * positions[1] + positions[0]
    target = (acceleration - normalizer.mean) / normalizer.std
    error = (prediction(run, state_of(run, window), window) - target).square()
    near = window.environment.distance_and_normal(positions[1])[0] < NEAR_SURFACE_DISTANCE
    assert 0 < near.sum() < len(near)
    weight = torch.where(near, NEAR_WEIGHT, 1.0)
    torch.testing.assert_close(loss, (weight * error.mean(dim=1)).mean())
    torch.testing.assert_close(rows[0], torch.stack([loss, error[near].mean(), error[~near].mean()]))


def drifted(state: History, position: float, last_displacement: float) -> History:
    """The state moved along x, with another last displacement."""
    x = torch.tensor([1.0, 0.0, 0.0])
    displacements = torch.cat([state.displacements[:, :1] + last_displacement * x, state.displacements[:, 1:]], dim=1)
    return History(state.positions + position * x, state.velocities, displacements)


def test_the_target_of_a_state_with_small_drift_is_the_true_displacement(run, data):
    window = batch_of(run, data).windows[0]
    state = drifted(state_of(run, window), 0.001, 1e-3)
    target = run.objective.target_displacement(state, window, 0)
    torch.testing.assert_close(target, true_displacement(window, 0), atol=1e-6, rtol=0)


def test_the_target_of_a_state_with_large_drift_corrects_no_more_than_the_bound(run, data):
    window, bound = batch_of(run, data).windows[0], MAX_VELOCITY_DRIFT * FRAME_TIME
    state = drifted(state_of(run, window), 0.001, 3 * bound)
    target, true = run.objective.target_displacement(state, window, 0), true_displacement(window, 0)
    x = torch.tensor([1.0, 0.0, 0.0]).expand_as(target)
    torch.testing.assert_close(target - true, 2 * bound * x, atol=1e-6, rtol=0)


def test_the_density_term_has_the_weight_of_the_phase(run, data):
    windows = batch_of(run, data).windows
    without, with_term = (
        run.objective(Batch(windows, generators()), Phase(until=1, noise=0.01, density=weight))[0] for weight in (0, 2)
    )
    terms = []
    for window, random in zip(windows, generators(), strict=True):
        state = run.objective.disturb(state_of(run, window), window, Phase(until=1, noise=0.01), random)
        positions, _ = run.model.integrate(state, prediction(run, state, window))
        neighbors = find_neighbors(positions.detach(), 0.061)
        distance, _ = window.environment.distance_and_normal(positions)
        terms.append(density_loss(positions, neighbors, distance, window.environment))
    term = torch.stack(terms).mean()
    assert term > 0.01
    torch.testing.assert_close(with_term - without, 2 * term, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("kind", MESSAGE_PASSING)
def test_every_window_of_a_batch_counts(kind, tmp_path, data):
    run = TrainingRun(message_passing(kind), tmp_path)
    windows = batch_of(run, data).windows
    together, rows = run.objective(Batch(windows, generators()), QUIET)
    apart = [run.objective(Batch([window], generators()[:1]), QUIET)[1] for window in windows]
    torch.testing.assert_close(rows, torch.cat(apart), equal_nan=True, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(rows[:, 0].mean(), together)


def test_noise_has_the_configured_size_and_follows_from_the_generator(run, data):
    state = state_of(run, batch_of(run, data).windows[0])
    one, same, other = (run.objective.add_noise(state, 1e-3, generators()[number]) for number in (0, 0, 1))
    assert torch.equal(one.displacements, same.displacements)
    assert not torch.equal(one.displacements, other.displacements)
    assert 7e-4 < float((one.displacements - state.displacements)[:, 0].std()) < 1.4e-3


def test_the_target_of_a_state_inside_the_solid_leads_out(run, data):
    window = batch_of(run, data).windows[0]
    state = state_of(run, window)
    inside = torch.tensor([0.0, 0.0, 0.18])  # 20 mm below the top of the ball
    state = dataclasses.replace(state, positions=inside.expand_as(state.positions))
    target = state.positions + run.objective.target_displacement(state, window, 0)
    before, after = (window.environment.distance_and_normal(at)[0] for at in (state.positions, target))
    assert ((after - before) > 0.99 * MAX_VELOCITY_DRIFT * FRAME_TIME).all()


def test_the_small_error_term_has_the_weight_of_the_phase(run, data):
    windows = batch_of(run, data).windows
    without, with_term = (
        run.objective(Batch(windows, generators()), Phase(until=1, noise=0, small_errors=weight))[0]
        for weight in (0, 2)
    )
    terms = []
    for window in windows:
        state = state_of(run, window)
        target = run.model.acceleration_target(state, run.objective.target_displacement(state, window, 0))
        error = (prediction(run, state, window) - target).square().mean(dim=1)
        terms.append((1 + error / 0.1**2).log().mean())
    torch.testing.assert_close(with_term - without, 2 * torch.stack(terms).mean(), rtol=1e-4, atol=1e-4)


def test_the_share_of_windows_with_displaced_water_is_that_of_the_phase(run, data):
    window = batch_of(run, data, 3).windows[0]
    positions = torch.cat([torch.tensor([[0.0, 0.0, 0.23]]), window.positions[run.model.history_length, 1:]])
    near = dataclasses.replace(window, positions=positions.expand(len(window.positions), -1, -1))
    random, true = np.random.default_rng(0), state_of(run, near)

    def count(share: float) -> int:
        states = (
            run.objective.disturb(true, near, Phase(until=1, noise=0, displaced=share), random) for _ in range(60)
        )
        return sum(not torch.equal(state.positions, true.positions) for state in states)

    assert count(0) == 0
    assert 15 < count(0.5) < 45
    assert count(1) == 60


def test_a_step_passes_a_gradient_to_every_weight(run, data):
    loss, _ = run.objective(batch_of(run, data, 7), run.config.phase(7))
    loss.backward()
    assert all(parameter.grad is not None and parameter.grad.isfinite().all() for parameter in run.model.parameters())


def test_the_measured_normalizers_normalize_the_training_data(run, data):
    fit_normalizers(Windows(data), run)
    windows, normalized = Windows(data), []
    for number in range(NORMALIZATION_WINDOWS):
        random = np.random.default_rng([run.config.seed, run.config.steps, number])
        window = windows.sample(random, run.model.history_length, 1)
        state = run.objective.add_noise(state_of(run, window), run.config.phase(0).noise, random)
        normalized.append(run.model.acceleration_target(state, true_displacement(window, 0)))
    targets = torch.cat(normalized)
    torch.testing.assert_close(targets.mean(dim=0), torch.zeros(3), atol=1e-3, rtol=0)
    torch.testing.assert_close(targets.std(dim=0), torch.ones(3), atol=1e-3, rtol=0)
    assert torch.equal(run.average.acceleration_normalizer.std, run.model.acceleration_normalizer.std)


def test_bf16_is_for_the_network_alone(tmp_path, data):
    run = TrainingRun(message_passing("surfsup", width=32), tmp_path / "32")
    rounded = TrainingRun(message_passing("surfsup", width=32, precision="bf16"), tmp_path / "bf16")
    windows = batch_of(run, data).windows
    (exact, _), (close, _) = (one.objective(Batch(windows, generators()), QUIET) for one in (run, rounded))
    assert close.dtype == torch.float32
    assert exact != close
    torch.testing.assert_close(close, exact, rtol=0.02, atol=0)
