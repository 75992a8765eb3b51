import math

import pytest
import torch

from surfsup.training.config import Phase
from surfsup.training.objectives import Batch
from surfsup.training.run import Run
from surfsup.training.step import NotANumber, take_step
from tests.training.conftest import MESSAGE_PASSING, batch_of, config, fresh, message_passing


@pytest.mark.parametrize("kind", [{}, {"unroll": 2}, {"unroll": 2, "calm": 0.5}])
def test_a_few_dozen_steps_on_one_window_lower_the_loss(tmp_path, data, kind):
    phase = Phase(until=1, noise=0, **kind)
    run = Run(config(width=16, phases=[phase], steps=1000, warm_up=1, learning_rate=1e-2), tmp_path)
    windows = batch_of(run, data, 3).windows
    losses = [take_step(run, Batch(windows, fresh())).loss for _ in range(60)]
    assert losses[-1] < 0.5 * losses[0]


@pytest.mark.parametrize("kind", MESSAGE_PASSING)
def test_so_they_do_for_the_papers_networks(tmp_path, data, kind):
    phase = Phase(until=1, noise=0)
    run = Run(message_passing(kind, width=16, phases=[phase], steps=1000, warm_up=1, learning_rate=5e-3), tmp_path)
    windows = batch_of(run, data, 3).windows
    losses = [take_step(run, Batch(windows, fresh())).loss for _ in range(60)]
    assert min(losses[-20:]) < 0.65 * losses[0]  # at this rate it swings


def test_the_average_follows_the_weights(tmp_path, data):
    run = Run(config(averaging=0.9), tmp_path)
    before = [value.clone() for value in run.average.parameters()]
    take_step(run, batch_of(run, data))
    for was, now, new in zip(before, run.average.parameters(), run.model.parameters(), strict=True):
        torch.testing.assert_close(now, was + 0.9 * (new - was))  # young: it keeps a tenth
        assert not now.requires_grad


def test_a_gradient_longer_than_the_clip_is_shortened(tmp_path, data):
    run = Run(config(clip=1e-4), tmp_path)
    report = take_step(run, batch_of(run, data))
    left = torch.stack([parameter.grad.norm() for parameter in run.model.parameters()]).norm()
    assert report.gradient > 2e-4
    assert float(left) == pytest.approx(1e-4, rel=1e-2)


def test_a_step_tells_of_its_windows(tmp_path, data):
    run = Run(config(), tmp_path)
    report = take_step(run, batch_of(run, data))
    assert [window[0] for window in report.windows] == ["sphere", "sphere"]
    assert sum(window[1] for window in report.windows) / 2 == pytest.approx(report.loss)
    assert report.rate == pytest.approx(run.config.learning_rate / 3)


def test_a_step_that_is_no_number_names_its_scene_and_leaves_the_weights_alone(tmp_path, data):
    run = Run(config(), tmp_path)
    batch = batch_of(run, data)
    with torch.no_grad():
        batch.windows[1].positions[-1] = math.nan
    before = {name: value.clone() for name, value in run.model.state_dict().items()}
    name = batch.windows[1].name
    with pytest.raises(NotANumber, match=rf"not a number at step 0, in {name}; no checkpoint had been written"):
        take_step(run, batch)
    assert all(torch.equal(value, before[name]) for name, value in run.model.state_dict().items())
