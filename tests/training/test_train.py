import csv
import os
import shutil
import signal

import h5py
import pytest
import torch

from surfsup.datasets.windows import Windows
from surfsup.errors import InputError
from surfsup.learned import weights_file
from surfsup.optim.stopping import Stop as Stopping
from surfsup.training import train as training
from surfsup.training.train import NotANumber, Run, train
from tests.training.conftest import Stop, assert_same, batch_of, config, message_passing, stop_at


@pytest.mark.parametrize(
    "of", [config(), config(optimizer="soap"), message_passing("surfsup"), message_passing("gns")]
)
def test_a_resumed_run_is_bit_for_bit_the_undisturbed_one(tmp_path, data, of):
    straight = Run(of, tmp_path / "straight")
    train(straight, Windows(data), data)

    # Stopped two steps after the checkpoint, so that two steps are lost and done again.
    with pytest.raises(Stop):
        train(Run(of, tmp_path / "halves"), Windows(data), data, report=stop_at(6))
    resumed = Run(of, tmp_path / "halves")
    resumed.resume()
    assert resumed.step == 4
    train(resumed, Windows(data), data)

    assert_same(resumed, straight)
    assert (resumed.best, resumed.seen) == (straight.best, straight.seen)
    best = [weights_file.load(tmp_path / name / "best.safetensors")[0].state_dict() for name in ("straight", "halves")]
    assert all(torch.equal(best[0][name], best[1][name]) for name in best[0])


def test_a_run_leaves_checkpoint_log_and_the_best_weights(tmp_path, data):
    told = []
    run = Run(config(), tmp_path / "run")
    train(run, Windows(data), data, report=told.append)
    assert {path.name for path in run.folder.iterdir()} == {
        "checkpoint.safetensors",
        "checkpoint-before.safetensors",
        "log.csv",
        "best.safetensors",
    }
    assert [progress.step for progress in told] == list(range(1, 9))
    assert [progress.step for progress in told if progress.scores] == [4, 8]
    log = (run.folder / "log.csv").read_text().splitlines()
    assert log[0].startswith("step,seconds,loss,chamfer")
    assert [line.split(",")[0] for line in log[1:]] == ["4", "8"]
    simulator, card = weights_file.load(run.folder / "best.safetensors")
    assert simulator.architecture == run.model.architecture
    assert '"seed":5' in card.about
    assert card.seen.particles == run.seen.particles
    assert card.seen.sides == (0.4, 0.4)
    assert card.seen.surfaces == ("sphere",)
    assert card.seen.gravity == pytest.approx((9.014, 9.81), rel=1e-3)
    assert 1.4 < card.seen.fastest < 4


def test_a_checkpoint_is_written_between_rollouts_too(tmp_path, data, monkeypatch):
    monkeypatch.setattr(training, "SAVE_EVERY", 0)
    with pytest.raises(Stop):
        train(Run(config(judge_every=100), tmp_path), Windows(data), data, report=stop_at(3))
    resumed = Run(config(judge_every=100), tmp_path)
    resumed.resume()
    assert resumed.step == 3


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_a_checkpoint_to_go_on_from(tmp_path, data, number):
    def interrupt(progress) -> None:
        if progress.step == 5:
            os.kill(os.getpid(), number)

    run = Run(config(), tmp_path)
    with Stopping() as stop:
        train(run, Windows(data), data, stop, interrupt)
    assert run.step == 5
    resumed = Run(config(), tmp_path)
    resumed.resume()
    assert resumed.step == 5
    train(resumed, Windows(data), data)
    straight = Run(config(), tmp_path / "straight")
    train(straight, Windows(data), data)
    assert_same(resumed, straight)


def test_a_run_stopped_before_its_first_step_loses_nothing(tmp_path, data):
    of = message_passing("surfsup")  # whose normalizations are measured before the first step
    run = Run(of, tmp_path)
    train(run, Windows(data), data, Stopping(0))
    assert run.step == 0
    resumed = Run(of, tmp_path)
    resumed.resume()
    train(resumed, Windows(data), data)
    straight = Run(of, tmp_path / "straight")
    train(straight, Windows(data), data)
    assert_same(resumed, straight)


def test_rollouts_that_were_cut_short_are_done_on_resuming(tmp_path, data):
    asked = iter([False] * 4)  # before four steps; then the first scene of the first rollouts stops the run
    train(Run(config(), tmp_path), Windows(data), data, lambda: next(asked, True))
    assert not (tmp_path / "log.csv").exists()
    resumed = Run(config(), tmp_path)
    resumed.resume()
    assert resumed.step == 4
    train(resumed, Windows(data), data, Stopping(0.0))
    assert not (tmp_path / "best.safetensors").exists()
    train(resumed, Windows(data), data)
    rows = list(csv.reader((tmp_path / "log.csv").open()))
    assert [row[0] for row in rows] == ["step", "4", "8"]


def test_a_finished_run_has_nothing_left_to_do(tmp_path, data):
    run = Run(config(steps=2), tmp_path)
    train(run, Windows(data), data)
    train(run, Windows(data), data)
    assert run.step == 2


def test_another_seed_is_another_run(tmp_path, data):
    runs = [Run(config(steps=1, seed=seed), tmp_path / str(seed)) for seed in (1, 2)]
    names = list(runs[0].model.state_dict())
    assert any(not torch.equal(runs[0].model.state_dict()[n], runs[1].model.state_dict()[n]) for n in names)
    positions = [batch_of(run, data).windows[0].positions for run in runs]
    assert not torch.equal(*positions)


@pytest.mark.filterwarnings("ignore:overflow")
def test_a_loss_that_is_no_number_stops_with_the_checkpoint_before(tmp_path, data):
    sane = Run(config(steps=100), tmp_path)
    with pytest.raises(Stop):
        train(sane, Windows(data), data, report=stop_at(5))
    before = sane.files.last.read_bytes()
    wild = Run(config(steps=100), tmp_path)
    wild.resume()
    with torch.no_grad():
        for value in wild.model.parameters():
            value.mul_(1e30)
    with pytest.raises(NotANumber, match=r"not a number at step 4, in .*0000[01].h5.*; .*checkpoint"):
        train(wild, Windows(data), data)
    assert sane.files.last.read_bytes() == before
    resumed = Run(config(steps=100), tmp_path)
    resumed.resume()
    assert resumed.step == 4


def test_folders_without_trajectories_are_refused_before_anything_is_done(tmp_path, data):
    (tmp_path / "empty").mkdir()
    for train_on, judge_by in ((tmp_path / "empty", data), (data, tmp_path / "empty")):
        run = Run(config(), tmp_path / "run")
        with pytest.raises(InputError, match="empty: has no trajectories"):
            train(run, Windows(train_on), judge_by)
        assert run.step == 0


def test_a_run_may_stop_before_its_schedule_ends(tmp_path, data):
    run = Run(config(stop=5), tmp_path)
    train(run, Windows(data), data)
    assert run.step == 5
    assert (tmp_path / "best.safetensors").exists()


def test_validation_scenes_of_other_particles_are_refused_before_anything_is_done(tmp_path, data):
    shutil.copytree(data, tmp_path / "other")
    with h5py.File(tmp_path / "other/00001.h5", "r+") as file:
        file.attrs["radius"] = 0.025
    run = Run(config(judge_scenes=2), tmp_path / "run")
    with pytest.raises(InputError, match=r"00001\.h5: has .* radius 0\.025 m; the simulators here are for .* 0\.015 m"):
        train(run, Windows(data), tmp_path / "other")
    assert (run.step, run.folder.exists()) == (0, False)
