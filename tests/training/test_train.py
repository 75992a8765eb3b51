import csv
import os
import shutil
import signal
import warnings

import h5py
import pytest
import torch

from surfsup.datasets.windows import Windows
from surfsup.errors import InputError
from surfsup.learned import weights_file
from surfsup.optim.run import Diverged
from surfsup.optim.stopping import Stop as Stopping
from surfsup.training.config import Phase
from surfsup.training.run import TrainingRun
from surfsup.training.train import train
from tests.training.conftest import (
    SCENE,
    Stop,
    assert_same,
    batch_of,
    config,
    message_passing,
    stop_at,
    write_trajectory,
)


@pytest.mark.parametrize(
    "options", [config(), config(optimizer="soap"), message_passing("surfsup"), message_passing("gns")]
)
def test_a_resumed_run_equals_an_uninterrupted_one_bit_for_bit(tmp_path, data, options):
    straight = TrainingRun(options, tmp_path / "straight")
    train(straight, Windows(data), data)

    # Killed two steps after a checkpoint, so that two steps are lost and repeated.
    with pytest.raises(Stop):
        train(TrainingRun(options, tmp_path / "halves"), Windows(data), data, report=stop_at(6))
    resumed = TrainingRun(options, tmp_path / "halves")
    resumed.resume()
    assert resumed.step == 4
    train(resumed, Windows(data), data)

    assert_same(resumed, straight)
    assert (resumed.best_score, resumed.training_domain) == (straight.best_score, straight.training_domain)
    best = [weights_file.load(tmp_path / name / "best.safetensors")[0].state_dict() for name in ("straight", "halves")]
    assert all(torch.equal(best[0][name], best[1][name]) for name in best[0])


def test_a_run_leaves_checkpoints_a_log_and_the_best_weights(tmp_path, data):
    reports = []
    run = TrainingRun(config(), tmp_path / "run")
    train(run, Windows(data), data, report=reports.append)
    assert {path.name for path in run.folder.iterdir()} == {
        "checkpoint.safetensors",
        "checkpoint-before.safetensors",
        "log.csv",
        "best.safetensors",
    }
    assert [progress.step for progress in reports] == list(range(1, 9))
    assert [progress.step for progress in reports if progress.validation] == [4, 8]
    log = (run.folder / "log.csv").read_text().splitlines()
    assert log[0].startswith("step,seconds,loss,chamfer")
    assert [line.split(",")[0] for line in log[1:]] == ["4", "8"]
    simulator, card = weights_file.load(run.folder / "best.safetensors")
    assert simulator.architecture == run.model.architecture
    assert '"seed":5' in card.about
    domain = card.training_domain
    assert domain.particles == run.training_domain.particles
    assert domain.sides == (0.4, 0.4)
    assert domain.surfaces == ("sphere",)
    assert domain.gravity == pytest.approx((9.014, 9.81), rel=1e-3)
    assert 1.4 < domain.max_speed < 4


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_a_checkpoint(tmp_path, data, number):
    def interrupt(progress) -> None:
        if progress.step == 5:
            os.kill(os.getpid(), number)

    run = TrainingRun(config(), tmp_path)
    with Stopping() as stop:
        train(run, Windows(data), data, stop, interrupt)
    assert run.step == 5
    resumed = TrainingRun(config(), tmp_path)
    resumed.resume()
    assert resumed.step == 5
    train(resumed, Windows(data), data)
    straight = TrainingRun(config(), tmp_path / "straight")
    train(straight, Windows(data), data)
    assert_same(resumed, straight)


def test_a_run_stopped_before_its_first_step_loses_nothing(tmp_path, data):
    options = message_passing("surfsup")  # its normalizers are measured before the first step
    run = TrainingRun(options, tmp_path)
    train(run, Windows(data), data, Stopping(0))
    assert run.step == 0
    resumed = TrainingRun(options, tmp_path)
    resumed.resume()
    train(resumed, Windows(data), data)
    straight = TrainingRun(options, tmp_path / "straight")
    train(straight, Windows(data), data)
    assert_same(resumed, straight)


def test_an_interrupted_validation_is_repeated_on_resuming(tmp_path, data):
    answers = iter([False] * 4)  # for four steps; then the stop comes after the first validation scene
    train(TrainingRun(config(), tmp_path), Windows(data), data, lambda: next(answers, True))
    assert not (tmp_path / "log.csv").exists()
    resumed = TrainingRun(config(), tmp_path)
    resumed.resume()
    assert resumed.step == 4
    train(resumed, Windows(data), data, Stopping(0.0))
    assert not (tmp_path / "best.safetensors").exists()
    train(resumed, Windows(data), data)
    rows = list(csv.reader((tmp_path / "log.csv").open()))
    assert [row[0] for row in rows] == ["step", "4", "8"]


def test_another_seed_gives_other_weights_and_windows(tmp_path, data):
    runs = [TrainingRun(config(steps=1, seed=seed), tmp_path / str(seed)) for seed in (1, 2)]
    names = list(runs[0].model.state_dict())
    assert any(not torch.equal(runs[0].model.state_dict()[n], runs[1].model.state_dict()[n]) for n in names)
    positions = [batch_of(run, data).windows[0].positions for run in runs]
    assert not torch.equal(*positions)


@pytest.mark.filterwarnings("ignore:overflow")
def test_a_loss_that_is_not_a_number_keeps_the_checkpoint_before(tmp_path, data):
    sane = TrainingRun(config(steps=100), tmp_path)
    with pytest.raises(Stop):
        train(sane, Windows(data), data, report=stop_at(5))
    before = sane.files.last.read_bytes()
    wild = TrainingRun(config(steps=100), tmp_path)
    wild.resume()
    with torch.no_grad():
        for value in wild.model.parameters():
            value.mul_(1e30)
    with pytest.raises(Diverged, match=r"not a number at step 4, in .*0000[01].h5.*; .*checkpoint"):
        train(wild, Windows(data), data)
    assert sane.files.last.read_bytes() == before
    resumed = TrainingRun(config(steps=100), tmp_path)
    resumed.resume()
    assert resumed.step == 4


def test_a_run_resumed_with_other_data_says_so_and_continues(tmp_path, data):
    options = message_passing("surfsup", phases=[Phase(until=1, pushforward=3)])
    run = TrainingRun(options, tmp_path / "run")
    train(run, Windows(data), data, stop=lambda: run.step == 5)
    (tmp_path / "more").mkdir()
    for path in data.glob("*.h5"):
        shutil.copy(path, tmp_path / "more" / path.name)
        shutil.copy(path, tmp_path / "more" / f"again-{path.name}")
    for folder, changed in ((data, False), (tmp_path / "more", True), (tmp_path / "more", False)):
        resumed = TrainingRun(options, tmp_path / "run")
        resumed.resume()
        assert resumed.saved_states
        last = resumed.step + 1
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            train(resumed, Windows(folder), data, stop=lambda run=resumed, last=last: run.step == last)
        assert [str(one.message) for one in found if "training data has changed" in str(one.message)] == changed * [
            f"{tmp_path / 'run'}: the training data has changed; the run continues with the new data"
        ]


def test_a_network_with_surface_features_is_not_trained_without_surfaces(tmp_path, data):
    write_trajectory(tmp_path / "00000.h5", SCENE.model_copy(update={"surface": None}))
    with pytest.raises(InputError, match="'gns' learns from the surfaces of scenes, but the training data has none"):
        train(TrainingRun(message_passing("gns"), tmp_path / "gns"), Windows(tmp_path), data)
    train(TrainingRun(message_passing("no-sdf", steps=1), tmp_path / "no-sdf"), Windows(tmp_path), data)


def test_folders_without_trajectories_are_refused_before_the_first_step(tmp_path, data):
    (tmp_path / "empty").mkdir()
    for training, validation in ((tmp_path / "empty", data), (data, tmp_path / "empty")):
        run = TrainingRun(config(), tmp_path / "run")
        with pytest.raises(InputError, match="empty: has no trajectories"):
            train(run, Windows(training), validation)
        assert run.step == 0


def test_validation_scenes_of_another_radius_are_refused_before_the_first_step(tmp_path, data):
    shutil.copytree(data, tmp_path / "other")
    with h5py.File(tmp_path / "other/00001.h5", "r+") as file:
        file.attrs["radius"] = 0.025
    run = TrainingRun(config(validation_scenes=2), tmp_path / "run")
    with pytest.raises(InputError, match=r"00001\.h5: has .* radius 0\.025 m; the simulators here are for .* 0\.015 m"):
        train(run, Windows(data), tmp_path / "other")
    assert (run.step, run.folder.exists()) == (0, False)
