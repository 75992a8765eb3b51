import dataclasses

import pytest
import torch

from surfsup.errors import InputError
from surfsup.learned import weights_file
from surfsup.learned.corrected.simulator import Architecture, CorrectedSimulator
from surfsup.training.run import Run
from tests.training.conftest import config, message_passing


def complaint(run: Run) -> str:
    with pytest.raises(InputError) as error:
        run.resume()
    assert "\n" not in str(error.value)
    assert str(run.files.last) in str(error.value)
    return str(error.value)


def test_a_file_that_is_no_checkpoint_is_refused_in_one_line(tmp_path):
    run = Run(config(), tmp_path)
    weights_file.save(run.files.last, run.model, weights_file.Card("a", "b"))
    assert "no checkpoint" in complaint(run)


def test_no_checkpoint_or_one_of_another_configuration_is_refused(tmp_path):
    Run(config(), tmp_path).save()
    assert "no checkpoint to resume" in complaint(Run(config(), tmp_path / "new"))
    assert "another configuration" in complaint(Run(config(seed=6), tmp_path))
    assert "another configuration" in complaint(Run(message_passing("surfsup"), tmp_path))


def test_a_checkpoint_of_an_older_version_is_refused_in_one_line(tmp_path):
    run = Run(config(), tmp_path)
    run.save()
    kept = run.files.load()
    del kept.counters["judged"]
    run.files.save(kept)
    assert "no checkpoint of this version" in complaint(run)
    run.files.save(dataclasses.replace(kept, config='{"kind": "unheard of"}'))
    assert "another configuration" in complaint(run)


@pytest.mark.parametrize("of", [config(), message_passing("gns")])
def test_the_averaged_weights_of_a_run_are_in_its_folder(of, tmp_path):
    run = Run(of, tmp_path)
    with pytest.raises(InputError, match="there is no checkpoint"):
        Run.average_of(tmp_path)
    run.average.load_state_dict(Run(of.model_copy(update={"seed": 9}), tmp_path).model.state_dict())
    run.save()
    kept = Run.average_of(tmp_path)
    assert (kept.kind, kept.architecture) == (run.model.kind, run.model.architecture)
    assert all(torch.equal(value, run.average.state_dict()[name]) for name, value in kept.state_dict().items())
    broken = run.files.load()
    run.files.save(dataclasses.replace(broken, tensors=dict(list(broken.tensors.items())[1:])))
    with pytest.raises(InputError, match="no checkpoint of this version"):
        Run.average_of(tmp_path)


@pytest.mark.parametrize("of", [config(), message_passing("gns")])
def test_a_run_can_start_from_trained_weights_of_its_own_architecture(of, tmp_path):
    trained = Run(of.model_copy(update={"seed": 9}), tmp_path).model
    run = Run(of, tmp_path)
    run.start_from(trained)
    for begun in (run.model, run.average):
        assert all(torch.equal(value, trained.state_dict()[name]) for name, value in begun.state_dict().items())
    for other in (CorrectedSimulator(Architecture(width=3, layers=1)), Run(message_passing("no-sdf"), tmp_path).model):
        with pytest.raises(InputError, match="the weights to start from are of"):
            run.start_from(other)
