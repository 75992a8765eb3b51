import dataclasses

import numpy as np
import pytest
import torch

from surfsup.datasets.windows import Window, Windows
from surfsup.learned.message_passing.history import History
from surfsup.scene import NEAR_SURFACE_DISTANCE
from surfsup.sph.neighbor_search import find_neighbors
from surfsup.training.batches import EXAMPLES, prepare, read_batch
from surfsup.training.config import Phase
from surfsup.training.objectives import Batch
from surfsup.training.objectives.acceleration import NEAR_WEIGHT
from surfsup.training.objectives.density_loss import density_loss
from surfsup.training.objectives.strayed import FASTEST
from surfsup.training.run import Run
from tests.training.conftest import MESSAGE_PASSING, batch_of, fresh, message_passing

QUIET = Phase(until=1, noise=0)


@pytest.fixture(params=[1, 2])
def run(request, tmp_path) -> Run:
    return Run(message_passing("surfsup", stride=request.param), tmp_path)


def test_the_loss_is_the_weighted_squared_error_of_the_normalized_acceleration(run, data):
    (window, _), model, stride = batch_of(run, data).windows, run.model, run.model.architecture.stride
    assert (window.past, window.following) == (2 * stride, stride)
    loss, rows = run.objective(Batch([window], fresh()[:1]), QUIET)
    # The same from the true frames, written out.
    places = [window.frame(number)[0] for number in (-stride, 0, stride)]
    acceleration = places[2] - 2 * places[1] + places[0]
    wanted = (acceleration - model.accelerations.mean) / model.accelerations.spread
    error = (model.predict(model.observe(model.state_after(*window.up_to_now), window.environment)) - wanted).square()
    near = window.environment.distance_and_normal(places[1])[0] < NEAR_SURFACE_DISTANCE
    assert 0 < near.sum() < len(near)
    weight = torch.where(near, NEAR_WEIGHT, 1.0)
    torch.testing.assert_close(loss, (weight * error.mean(dim=1)).mean())
    torch.testing.assert_close(rows[0], torch.stack([loss, error[near].mean(), error[~near].mean()]))


def strayed(state: History, place: float, last: float, faster: float) -> History:
    """The state moved aside along x, with another last move and velocity."""
    aside = torch.tensor([1.0, 0.0, 0.0])
    moves = torch.cat([state.moves[:, :1] + last * aside, state.moves[:, 1:]], dim=1)
    return History(state.positions + place * aside, state.velocities + faster * aside, moves)


def test_a_state_that_strayed_a_little_is_asked_for_the_true_step(run, data):
    window = batch_of(run, data).windows[0]
    state = strayed(run.model.state_after(*window.up_to_now), 0.2, 1e-3, 0.1)
    for asked, true in zip(run.objective.asked_step(state, window, 0), run.objective.true_step(window, 0), strict=True):
        torch.testing.assert_close(asked, true, atol=1e-6, rtol=0)


def test_a_state_that_strayed_far_is_asked_to_make_good_no_more_than_the_bound(run, data):
    window, time = batch_of(run, data).windows[0], run.model.step_time
    true_state, true = run.model.state_after(*window.up_to_now), run.objective.true_step(window, 0)
    state = strayed(true_state, 0.2, 3 * FASTEST * time, 3 * FASTEST)
    move, velocities = run.objective.asked_step(state, window, 0)
    aside = torch.tensor([1.0, 0.0, 0.0]).expand_as(move)
    torch.testing.assert_close(move - true[0], 2 * FASTEST * time * aside, atol=1e-6, rtol=0)
    torch.testing.assert_close(velocities - true[1], 2 * FASTEST * aside, atol=1e-5, rtol=0)


def test_squeezing_costs_what_the_phase_weighs_it(run, data):
    windows = batch_of(run, data).windows
    plain, dear = (
        run.objective(Batch(windows, fresh()), Phase(until=1, noise=0.01, density=weight))[0] for weight in (0, 2)
    )
    states = [
        run.objective.with_noise(run.model.state_after(*window.up_to_now), 0.01, random)
        for window, random in zip(windows, fresh(), strict=True)
    ]
    reached = [
        run.model.advance(s, run.model.predict(run.model.observe(s, w.environment)))[0]
        for s, w in zip(states, windows, strict=True)
    ]
    squeezed = torch.stack(
        [
            density_loss(
                places,
                find_neighbors(places.detach(), 0.061),
                window.environment.distance_and_normal(places)[0],
                window.environment,
            )
            for places, window in zip(reached, windows, strict=True)
        ]
    ).mean()
    assert squeezed > 0.01
    torch.testing.assert_close(dear - plain, 2 * squeezed, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("kind", MESSAGE_PASSING)
def test_every_window_of_a_batch_counts(kind, tmp_path, data):
    run = Run(message_passing(kind), tmp_path)
    windows = batch_of(run, data).windows
    together, rows = run.objective(Batch(windows, fresh()), QUIET)
    apart = [run.objective(Batch([window], fresh()[:1]), QUIET)[1] for window in windows]
    torch.testing.assert_close(rows, torch.cat(apart), equal_nan=True, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(rows[:, 0].mean(), together)


def test_noise_strays_by_what_is_asked_for_and_follows_from_the_generator(run, data):
    state = run.model.state_after(*batch_of(run, data).windows[0].up_to_now)
    assert run.objective.with_noise(state, 0.0, fresh()[0]) is state
    one, same, other = (run.objective.with_noise(state, 1e-3, fresh()[number]) for number in (0, 0, 1))
    assert torch.equal(one.moves, same.moves)
    assert not torch.equal(one.moves, other.moves)
    assert 7e-4 < float((one.moves - state.moves)[:, 0].std()) < 1.4e-3


def test_a_window_that_begins_with_its_scene_gets_no_noise(run, data):
    window = batch_of(run, data).windows[0]
    quiet, noisy = Phase(until=1, noise=0), Phase(until=1, noise=1e-3)
    begun = dataclasses.replace(window, begins=True)

    def loss(window: Window, phase: Phase) -> torch.Tensor:
        return run.objective(Batch([window], fresh()[:1]), phase)[0]

    assert torch.equal(loss(begun, noisy), loss(window, quiet))
    assert not torch.equal(loss(window, noisy), loss(window, quiet))


def test_unrolled_steps_pass_a_gradient_to_every_weight(run, data):
    batch = read_batch(Windows(data), run, 7)  # of the last phase
    assert batch.windows[0].following >= 2 * run.objective.frames_per_step
    loss, _ = run.objective(batch, run.config.phase(7))
    loss.backward()
    assert all(parameter.grad is not None and parameter.grad.isfinite().all() for parameter in run.model.parameters())


def test_preparing_measures_what_the_network_sees(run, data):
    prepare(Windows(data), run)
    windows, stride, normalized = Windows(data), run.objective.frames_per_step, []
    for number in range(EXAMPLES):
        random = np.random.default_rng([run.config.seed, run.config.steps, number])
        window = windows.draw(random, run.model.past, stride)
        state = run.objective.with_noise(run.model.state_after(*window.up_to_now), run.config.phase(0).noise, random)
        normalized.append(run.model.wanted(state, *run.objective.true_step(window, 0)))
    every = torch.cat(normalized)
    torch.testing.assert_close(every.mean(dim=0), torch.zeros(3), atol=1e-3, rtol=0)
    torch.testing.assert_close(every.std(dim=0), torch.ones(3), atol=1e-3, rtol=0)
    assert torch.equal(run.average.accelerations.spread, run.model.accelerations.spread)


def test_bf16_is_for_the_network_alone(tmp_path, data):
    run = Run(message_passing("surfsup", width=32), tmp_path / "32")
    rounded = Run(message_passing("surfsup", width=32, precision="bf16"), tmp_path / "bf16")
    batch = batch_of(run, data).windows
    (exact, _), (close, _) = (one.objective(Batch(batch, fresh()), QUIET) for one in (run, rounded))
    assert close.dtype == torch.float32
    assert exact != close
    torch.testing.assert_close(close, exact, rtol=0.02, atol=0)
