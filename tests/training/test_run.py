import dataclasses
import math

import pytest
import torch

from surfsup.errors import InputError
from surfsup.learned import weights_file
from surfsup.learned.corrected.simulator import CorrectedArchitecture, CorrectedSimulator
from surfsup.optim.run import Diverged
from surfsup.training.config import Phase
from surfsup.training.objectives import Batch
from surfsup.training.run import TrainingRun, load_average
from tests.training.conftest import MESSAGE_PASSING, batch_of, config, generators, message_passing


def resume_error(run: TrainingRun) -> str:
    with pytest.raises(InputError) as error:
        run.resume()
    assert "\n" not in str(error.value)
    assert str(run.files.last) in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("terms", [{}, {"small_errors": 0.5}])
def test_a_few_dozen_steps_on_one_window_lower_the_loss(tmp_path, data, terms):
    phase = Phase(until=1, noise=0, **terms)
    run = TrainingRun(config(width=16, phases=[phase], steps=1000, warm_up=1, learning_rate=1e-2), tmp_path)
    windows = batch_of(run, data, 3).windows
    losses = [run.take_step(Batch(windows, generators())).loss for _ in range(60)]
    assert losses[-1] < 0.5 * losses[0]


@pytest.mark.parametrize("kind", MESSAGE_PASSING)
def test_they_lower_the_loss_of_the_paper_s_networks_too(tmp_path, data, kind):
    phase = Phase(until=1, noise=0)
    options = message_passing(kind, width=16, phases=[phase], steps=1000, warm_up=1, learning_rate=5e-3)
    run = TrainingRun(options, tmp_path)
    windows = batch_of(run, data, 3).windows
    losses = [run.take_step(Batch(windows, generators())).loss for _ in range(60)]
    assert min(losses[-20:]) < 0.65 * losses[0]  # at this learning rate it oscillates


def test_a_step_records_the_errors_of_its_windows(tmp_path, data):
    run = TrainingRun(config(), tmp_path)
    report = run.take_step(batch_of(run, data))
    assert [kind for kind, *_ in run.window_errors] == ["sphere", "sphere"]
    assert sum(loss for _, loss, *_ in run.window_errors) / 2 == pytest.approx(report.loss)
    assert report.learning_rate == pytest.approx(run.config.learning_rate / 3)


def test_a_loss_that_is_not_a_number_names_its_scene_and_leaves_the_weights_unchanged(tmp_path, data):
    run = TrainingRun(config(), tmp_path)
    batch = batch_of(run, data)
    with torch.no_grad():
        batch.windows[1].positions[-1] = math.nan
    before = {name: value.clone() for name, value in run.model.state_dict().items()}
    name = batch.windows[1].name
    with pytest.raises(Diverged, match=rf"not a number at step 0, in {name}; no checkpoint had been written"):
        run.take_step(batch)
    assert all(torch.equal(value, before[name]) for name, value in run.model.state_dict().items())


def test_a_file_that_is_not_a_checkpoint_is_refused_in_one_line(tmp_path):
    run = TrainingRun(config(), tmp_path)
    weights_file.save(run.files.last, run.model, weights_file.Card("a", "b"))
    assert "no checkpoint" in resume_error(run)


def test_a_missing_checkpoint_or_one_of_another_configuration_is_refused(tmp_path):
    TrainingRun(config(), tmp_path).save()
    assert "no checkpoint to resume" in resume_error(TrainingRun(config(), tmp_path / "new"))
    assert "another configuration" in resume_error(TrainingRun(config(seed=6), tmp_path))
    assert "another configuration" in resume_error(TrainingRun(message_passing("surfsup"), tmp_path))


def test_an_incomplete_checkpoint_is_refused_in_one_line(tmp_path):
    run = TrainingRun(config(), tmp_path)
    run.save()
    checkpoint = run.files.load()
    del checkpoint.counters["validated_step"]
    run.files.save(checkpoint)
    assert "is not a checkpoint of such a run" in resume_error(run)
    run.files.save(dataclasses.replace(checkpoint, config='{"kind": "unheard of"}'))
    assert "another configuration" in resume_error(run)


@pytest.mark.parametrize("options", [config(), message_passing("gns")])
def test_the_averaged_weights_of_a_run_can_be_loaded_from_its_folder(options, tmp_path):
    run = TrainingRun(options, tmp_path)
    with pytest.raises(InputError, match="there is no checkpoint"):
        load_average(tmp_path)
    run.average.load_state_dict(TrainingRun(options.model_copy(update={"seed": 9}), tmp_path).model.state_dict())
    run.save()
    loaded = load_average(tmp_path)
    assert (loaded.kind, loaded.architecture) == (run.model.kind, run.model.architecture)
    assert all(torch.equal(value, run.average.state_dict()[name]) for name, value in loaded.state_dict().items())
    checkpoint = run.files.load()
    run.files.save(dataclasses.replace(checkpoint, tensors=dict(list(checkpoint.tensors.items())[1:])))
    with pytest.raises(InputError, match="is not a checkpoint of a training run"):
        load_average(tmp_path)


@pytest.mark.parametrize("options", [config(), message_passing("gns")])
def test_a_run_can_start_from_trained_weights_of_its_architecture(options, tmp_path):
    trained = TrainingRun(options.model_copy(update={"seed": 9}), tmp_path).model
    run = TrainingRun(options, tmp_path)
    run.start_from(trained)
    for started in (run.model, run.average):
        assert all(torch.equal(value, trained.state_dict()[name]) for name, value in started.state_dict().items())
    other_sizes = CorrectedSimulator(CorrectedArchitecture(width=3, layers=1))
    for other in (other_sizes, TrainingRun(message_passing("no-sdf"), tmp_path).model):
        with pytest.raises(InputError, match="the weights to start from are of"):
            run.start_from(other)
