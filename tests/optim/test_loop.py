"""The loop on a problem of one weight."""

import math

import pytest
import torch
from torch import Tensor, nn

from surfsup.errors import InputError, SimulationError
from surfsup.optim import loop
from surfsup.optim.config import OptimizationConfig
from surfsup.optim.loop import Progress, optimize
from surfsup.optim.run import Diverged, Run
from tests.optim.conftest import config


class Line(Run[OptimizationConfig, nn.Linear, float]):
    """Minimizes the mean squared weight; a batch is the factor of the loss."""

    def __init__(self, folder, **changes) -> None:
        torch.manual_seed(0)
        model = nn.Linear(2, 2)
        options = config(**changes)
        super().__init__(options, folder, model, torch.optim.Adam(model.parameters(), lr=options.learning_rate))

    def loss(self, batch: float) -> Tensor:
        if batch < 0:
            raise SimulationError("diverged")
        return batch * self.model.weight.square().mean()


def run(line: Line, stop=lambda: False, validate=lambda: 1.0, report=None, batches=lambda step: 1.0 + step) -> None:
    optimize(line, batches, validate, stop, report)


def assert_same(one: Line, other: Line) -> None:
    assert one.step == other.step
    for mine, theirs in ((one.model, other.model), (one.average, other.average)):
        assert torch.equal(mine.weight, theirs.weight)


def test_a_resumed_run_equals_an_uninterrupted_one_bit_for_bit(tmp_path):
    straight = Line(tmp_path / "straight")
    run(straight)
    halted = Line(tmp_path / "halted")
    run(halted, stop=lambda: halted.step == 5)
    resumed = Line(tmp_path / "halted")
    resumed.resume()
    assert resumed.step == 5
    run(resumed)
    assert_same(resumed, straight)


def test_every_step_is_reported_with_its_loss_and_validation(tmp_path):
    reports: list[Progress[float]] = []
    run(Line(tmp_path), report=reports.append)
    assert [(one.step, one.steps) for one in reports] == [(step, 10) for step in range(1, 11)]
    assert [one.step for one in reports if one.validation] == [4, 8, 10]
    assert reports[0].loss == pytest.approx(reports[0].last_step.loss)
    assert reports[0].last_step.learning_rate == 0.1


def test_a_validation_that_was_stopped_is_repeated_on_resuming(tmp_path):
    validated = []
    run(Line(tmp_path), stop=lambda: bool(validated), validate=lambda: validated.append("stopped"))
    resumed = Line(tmp_path)
    resumed.resume()
    assert (resumed.step, resumed.validated_step) == (4, 0)
    run(resumed, validate=lambda: validated.append("done") or 1.0)
    assert validated == ["stopped", "done", "done", "done"]


def test_a_checkpoint_is_written_between_validations(tmp_path, monkeypatch):
    class Killed(Exception):
        pass

    def kill(progress) -> None:
        if progress.step == 3:
            raise Killed

    monkeypatch.setattr(loop, "SAVE_EVERY", 0)
    with pytest.raises(Killed):
        run(Line(tmp_path), report=kill)
    resumed = Line(tmp_path)
    resumed.resume()
    assert resumed.step == 3


def test_a_finished_run_takes_no_more_steps(tmp_path):
    line = Line(tmp_path)
    run(line)
    run(line)
    assert line.step == 10


@pytest.mark.parametrize("batch", [math.nan, math.inf, -1.0], ids=["nan", "infinite", "error"])
def test_a_loss_that_is_not_finite_leaves_the_weights_unchanged(tmp_path, batch):
    line = Line(tmp_path)
    line.take_step(1.0)
    before = line.model.weight.detach().clone()
    with pytest.raises(Diverged, match="not a number at step 1"):
        line.take_step(batch)
    assert torch.equal(line.model.weight, before)


def test_a_gradient_longer_than_the_clip_is_scaled_down(tmp_path):
    line = Line(tmp_path, clip=1e-4)
    report = line.take_step(1.0)
    assert report.gradient_norm > 2e-4
    assert float(line.model.weight.grad.norm()) == pytest.approx(1e-4, rel=1e-2)


def test_a_run_of_another_configuration_or_model_is_not_resumed(tmp_path):
    Line(tmp_path).save()
    with pytest.raises(InputError, match="belongs to a run of another configuration"):
        Line(tmp_path, seed=1).resume()
    other = Line(tmp_path)
    other.model = nn.Linear(3, 3)
    with pytest.raises(InputError, match="is not a checkpoint of such a run"):
        other.resume()
