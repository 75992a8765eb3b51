import dataclasses

import numpy as np
import pytest
import torch

from surfsup.datasets.windows import Window
from surfsup.training.config import Phase
from surfsup.training.objectives import Batch
from surfsup.training.run import TrainingRun
from tests.training.conftest import batch_of, config, generators, message_passing

QUIET = Phase(until=1, noise=0)


@pytest.fixture(params=[config(), message_passing("surfsup")], ids=["corrected", "surfsup"])
def run(request, tmp_path) -> TrainingRun:
    return TrainingRun(request.param, tmp_path)


@pytest.fixture
def window(run, data) -> Window:
    return batch_of(run, data).windows[0]


def noise_of(run: TrainingRun, window: Window, phase: Phase, random: np.random.Generator) -> float:
    """The standard deviation of the position noise of an initial state."""
    batch = Batch([window], [random])
    true, disturbed = run.objective.true_states(batch)[0], run.objective.initial_states(batch, phase)[0]
    return float((disturbed.positions - true.positions).std())


def test_the_noise_of_windows_is_spread_over_the_decades_of_the_phase(run, window):
    random = np.random.default_rng(0)
    full = noise_of(run, window, Phase(until=1, noise=1e-3, noise_decades=0), random)
    sizes = [noise_of(run, window, Phase(until=1, noise=1e-3), random) / full for _ in range(200)]
    assert 0.008 < min(sizes) < 0.02
    assert 0.8 < max(sizes) < 1.2
    assert 0.06 < np.median(sizes) < 0.16, "log-uniform: the median is at the middle decade"


def test_without_decades_all_windows_have_the_same_noise(run, window):
    random, phase = np.random.default_rng(0), Phase(until=1, noise=1e-3, noise_decades=0)
    sizes = [noise_of(run, window, phase, random) for _ in range(20)]
    assert max(sizes) < 1.2 * min(sizes)


def test_a_window_at_the_start_of_its_scene_gets_no_noise(run, window):
    noisy, at_start = Phase(until=1, noise=1e-3), dataclasses.replace(window, at_scene_start=True)
    assert noise_of(run, at_start, noisy, generators()[0]) == 0
    assert noise_of(run, window, QUIET, generators()[0]) == 0
    assert noise_of(run, window, noisy, generators()[0]) > 0


@pytest.mark.parametrize("handle_collisions", [True, False])
def test_a_rollout_in_training_has_collision_handling_if_the_phase_has_it(run, window, handle_collisions):
    batch = Batch([window], generators()[:1])
    state = run.objective.true_states(batch)[0]
    inside = state.positions[:1] * 0 + torch.tensor([0.0, 0.0, 0.18])  # 20 mm below the top of the ball
    batch.states = [dataclasses.replace(state, positions=torch.cat([inside, state.positions[1:]]))]
    run.objective(batch, Phase(until=1, noise=0, handle_collisions=handle_collisions))
    distance = window.environment.distance_and_normal(batch.states[0].positions[:1])[0]
    assert (float(distance) > 0) == handle_collisions
