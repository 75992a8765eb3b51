import math
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import torch

from surfsup.datasets.windows import Windows
from surfsup.errors import InputError
from surfsup.model import weights
from surfsup.model.simulator import Architecture, Simulator
from surfsup.training import train as training
from surfsup.training.config import Phase, TrainingConfig
from surfsup.training.step import batch_loss, learning_rate, take_step, with_noise
from surfsup.training.train import NotANumber, Progress, Run, read_batch, train


def config(**changes) -> TrainingConfig:
    standard = {
        "width": 6,
        "layers": 2,
        "batch": 2,
        "steps": 8,
        "warm_up": 3,
        "judge_every": 4,
        "judge_scenes": 1,
        "judge_frames": 6,
        "seed": 5,
        # One step of each kind of phase is enough to see that what is random in it repeats.
        "phases": [
            Phase(until=0.5),
            Phase(until=0.75, unseen=2, unroll=2),
            Phase(until=1, unseen=1, unroll=2, energy=1),
        ],
    }
    return TrainingConfig(**{**standard, **changes})


class Stop(Exception):
    pass


def stop_at(step: int):
    def report(progress: Progress) -> None:
        if progress.step == step:
            raise Stop

    return report


def assert_same(one: Run, other: Run) -> None:
    assert one.step == other.step
    for mine, theirs in ((one.model, other.model), (one.average, other.average)):
        for name, value in mine.state_dict().items():
            assert torch.equal(value, theirs.state_dict()[name]), name
    ours, others = one.optimizer.state_dict()["state"], other.optimizer.state_dict()["state"]
    assert all(torch.equal(ours[i][key], others[i][key]) for i in ours for key in ours[i])


def test_a_resumed_run_is_bit_for_bit_the_undisturbed_one(tmp_path, data):
    straight = Run(config(), tmp_path / "straight")
    train(straight, Windows(data), data)

    # Stopped two steps after the checkpoint, so that two steps are lost and done again.
    with pytest.raises(Stop):
        train(Run(config(), tmp_path / "halves"), Windows(data), data, report=stop_at(6))
    resumed = Run(config(), tmp_path / "halves")
    resumed.resume()
    assert resumed.step == 4
    train(resumed, Windows(data), data)

    assert_same(resumed, straight)
    assert resumed.best == straight.best
    best = [weights.load(tmp_path / name / "best.safetensors")[0].state_dict() for name in ("straight", "halves")]
    assert all(torch.equal(best[0][name], best[1][name]) for name in best[0])


def test_a_run_leaves_checkpoint_log_and_the_best_weights(tmp_path, data):
    told = []
    run = Run(config(), tmp_path / "run")
    train(run, Windows(data), data, report=told.append)
    assert {path.name for path in run.folder.iterdir()} == {
        "checkpoint.safetensors",
        "log.csv",
        "best.safetensors",
    }
    assert [progress.step for progress in told] == list(range(1, 9))
    assert [progress.step for progress in told if progress.scores] == [4, 8]
    log = (run.folder / "log.csv").read_text().splitlines()
    assert log[0].startswith("step,seconds,loss,chamfer")
    assert [line.split(",")[0] for line in log[1:]] == ["4", "8"]
    simulator, card = weights.load(run.folder / "best.safetensors")
    assert simulator.architecture == run.model.architecture
    assert '"seed":5' in card.about


def test_a_checkpoint_is_written_between_rollouts_too(tmp_path, data, monkeypatch):
    monkeypatch.setattr(training, "SAVE_EVERY", 2)
    with pytest.raises(Stop):
        train(Run(config(judge_every=100), tmp_path), Windows(data), data, report=stop_at(3))
    resumed = Run(config(judge_every=100), tmp_path)
    resumed.resume()
    assert resumed.step == 2


def test_time_up_is_a_checkpoint_to_go_on_from(tmp_path, data):
    run = Run(config(), tmp_path)
    train(run, Windows(data), data, until=time.monotonic() - 1)
    assert run.step == 0
    resumed = Run(config(), tmp_path)
    resumed.resume()
    train(resumed, Windows(data), data)
    straight = Run(config(), tmp_path / "straight")
    train(straight, Windows(data), data)
    assert_same(resumed, straight)


def test_a_finished_run_has_nothing_left_to_do(tmp_path, data):
    run = Run(config(steps=2), tmp_path)
    train(run, Windows(data), data)
    train(run, Windows(data), data)
    assert run.step == 2


def test_another_seed_is_another_run(tmp_path, data):
    runs = [Run(config(steps=1, seed=seed), tmp_path / str(seed)) for seed in (1, 2)]
    names = list(runs[0].model.state_dict())
    assert any(not torch.equal(runs[0].model.state_dict()[n], runs[1].model.state_dict()[n]) for n in names)
    windows = Windows(data)
    positions = [read_batch(windows, run.config, 0)[0][0].positions for run in runs]
    assert not torch.equal(*positions)


@pytest.mark.parametrize("kind", [{}, {"unroll": 2}, {"unroll": 2, "energy": 0.5}])
def test_a_few_dozen_steps_on_one_window_lower_the_loss(tmp_path, data, kind):
    phase = Phase(until=1, noise=0, **kind)
    run = Run(config(width=16, phases=[phase], steps=1000, warm_up=1, learning_rate=1e-2), tmp_path)
    batch, _ = read_batch(Windows(data), run.config, 3)
    losses = [take_step(run, batch, np.random.default_rng(0)) for _ in range(60)]
    assert losses[-1] < 0.5 * losses[0]


def test_the_average_follows_the_weights(tmp_path, data):
    run = Run(config(averaging=0.9), tmp_path)
    before = [value.clone() for value in run.average.parameters()]
    take_step(run, *read_batch(Windows(data), run.config, 0))
    for was, now, new in zip(before, run.average.parameters(), run.model.parameters(), strict=True):
        torch.testing.assert_close(now, was + 0.9 * (new - was))  # young: it keeps a tenth
        assert not now.requires_grad


@pytest.mark.filterwarnings("ignore:overflow")
def test_a_loss_that_is_no_number_stops_with_the_checkpoint_before(tmp_path, data):
    sane = Run(config(steps=100), tmp_path)
    with pytest.raises(Stop):
        train(sane, Windows(data), data, report=stop_at(5))
    before = sane.checkpoint.read_bytes()
    wild = Run(config(steps=100), tmp_path)
    wild.resume()
    with torch.no_grad():
        for value in wild.model.parameters():
            value.mul_(1e30)
    with pytest.raises(NotANumber, match=r"not a number at step 4; .*checkpoint"):
        train(wild, Windows(data), data)
    assert sane.checkpoint.read_bytes() == before
    resumed = Run(config(steps=100), tmp_path)
    resumed.resume()
    assert resumed.step == 4


def test_a_step_that_is_no_number_leaves_the_weights_alone(tmp_path, data):
    run = Run(config(), tmp_path)
    batch, random = read_batch(Windows(data), run.config, 0)
    with torch.no_grad():
        run.model.network.decoder[-1].weight.fill_(math.inf)
    before = {name: value.clone() for name, value in run.model.state_dict().items()}
    assert math.isnan(take_step(run, batch, random))
    assert all(torch.equal(value, before[name]) for name, value in run.model.state_dict().items())


def test_folders_without_trajectories_are_refused_before_anything_is_done(tmp_path, data):
    (tmp_path / "empty").mkdir()
    for train_on, judge_by in ((tmp_path / "empty", data), (data, tmp_path / "empty")):
        run = Run(config(), tmp_path / "run")
        with pytest.raises(InputError, match="empty: has no trajectories"):
            train(run, Windows(train_on), judge_by)
        assert run.step == 0


def complaint(run: Run) -> str:
    with pytest.raises(InputError) as error:
        run.resume()
    assert "\n" not in str(error.value)
    assert str(run.checkpoint) in str(error.value)
    return str(error.value)


@pytest.fixture
def checkpoint(tmp_path) -> Path:
    run = Run(config(), tmp_path)
    run.save()
    return run.checkpoint


@pytest.mark.parametrize("share", [0, 0.01, 0.5, 0.99])
def test_a_checkpoint_cut_off_is_refused_in_one_line(checkpoint, share):
    checkpoint.write_bytes(checkpoint.read_bytes()[: int(share * checkpoint.stat().st_size)])
    assert "cut off or no checkpoint" in complaint(Run(config(), checkpoint.parent))


def test_a_file_that_is_no_checkpoint_is_refused_in_one_line(checkpoint):
    run = Run(config(), checkpoint.parent)
    weights.save(checkpoint, run.model, weights.Card("a", "b"))
    assert "no checkpoint" in complaint(run)


def test_no_checkpoint_or_one_of_another_configuration_is_refused(checkpoint, tmp_path):
    assert "no checkpoint to resume" in complaint(Run(config(), tmp_path / "new"))
    assert "another configuration" in complaint(Run(config(seed=6), tmp_path))


def test_a_full_disk_leaves_the_checkpoint_before(checkpoint, monkeypatch):
    from surfsup.training import run as running

    def full(*arguments, **options):
        raise OSError(28, "No space left on device")

    before = checkpoint.read_bytes()
    monkeypatch.setattr(running, "save_file", full)
    with pytest.raises(InputError, match="cannot be written"):
        Run(config(), checkpoint.parent).save()
    assert checkpoint.read_bytes() == before


def test_the_learning_rate_rises_and_falls_to_its_end():
    schedule = config(steps=1000, warm_up=100, learning_rate=2e-3, final_learning_rate=2e-5)
    rates = [learning_rate(schedule, step) for step in range(1000)]
    assert rates[0] == pytest.approx(2e-5)
    assert rates[99] == rates[100] == pytest.approx(2e-3)
    assert rates[550] == pytest.approx((2e-3 + 2e-5) / 2)
    assert all(a < b for a, b in pairwise(rates[:100]))
    assert all(a > b for a, b in pairwise(rates[100:]))
    assert rates[-1] == pytest.approx(2e-5, rel=0.01)
    assert learning_rate(schedule, 1000) == pytest.approx(2e-5)


def test_noise_is_on_a_copy_and_never_larger_than_asked_for(data):
    batch, random = read_batch(Windows(data), config(), 0)
    state = batch[0].state
    before = {name: value.clone() for name, value in vars(state).items()}
    assert with_noise(state, 0, random) is state
    noisy = [with_noise(state, 1e-3, random) for _ in range(200)]
    spreads = [float((one.velocities - state.velocities).std()) * 0.005 for one in noisy]
    assert min(spreads) < 2e-5
    assert 8e-4 < max(spreads) < 1.2e-3
    assert all(torch.equal(value, before[name]) for name, value in vars(state).items())


def test_noise_looks_like_an_error_of_the_last_frame(data):
    batch, random = read_batch(Windows(data), config(), 0)
    state = batch[0].state
    noisy = with_noise(state, 1e-3, random)
    torch.testing.assert_close(
        noisy.positions - state.positions, noisy.displacement - state.displacement, atol=1e-6, rtol=0
    )
    torch.testing.assert_close(
        noisy.velocities - state.velocities, noisy.velocity_change - state.velocity_change, atol=1e-5, rtol=0
    )


def test_every_window_of_a_batch_counts(data, tmp_path):
    run = Run(config(), tmp_path)
    batch, _ = read_batch(Windows(data), run.config, 0)
    quiet = Phase(until=1, noise=0)
    random = np.random.default_rng(0)
    together = batch_loss(run.model, batch, quiet, random)
    apart = [batch_loss(run.model, [window], quiet, random) for window in batch]
    torch.testing.assert_close(together, torch.stack(apart).mean())


def test_a_run_can_start_from_trained_weights_of_its_own_architecture(tmp_path):
    torch.manual_seed(5)
    trained = Simulator(Run(config(), tmp_path).model.architecture)
    run = Run(config(), tmp_path)
    run.start_from(trained)
    for begun in (run.model, run.average):
        assert all(torch.equal(value, trained.state_dict()[name]) for name, value in begun.state_dict().items())
    with pytest.raises(InputError, match="the weights to start from are of"):
        run.start_from(Simulator(Architecture(width=3, layers=1)))


def test_a_run_may_stop_before_its_schedule_ends(tmp_path, data):
    run = Run(config(stop=5), tmp_path)
    train(run, Windows(data), data)
    assert run.step == 5
    assert (tmp_path / "best.safetensors").exists()
