from collections import Counter
from types import SimpleNamespace

import pytest
import torch

from surfsup.datasets.windows import Windows
from surfsup.training import batches as batches_module
from surfsup.training.batches import INTERLEAVED, Batches, drawn_at
from surfsup.training.config import Phase
from surfsup.training.run import TrainingRun
from surfsup.training.train import train
from tests.training.conftest import Stop, assert_same, config, message_passing, stop_at

LONG = [Phase(until=0.25), Phase(until=1, pushforward=2, noise=1e-3)]  # rollouts of three losses each


@pytest.fixture
def two_interleaved(monkeypatch):
    monkeypatch.setattr(batches_module, "INTERLEAVED", 2)


def test_without_pushforward_every_step_has_a_new_batch():
    options = config(steps=50, phases=[Phase(until=1)])
    assert [drawn_at(options, step) for step in range(50)] == list(range(50))


def test_a_batch_returns_until_its_rollouts_have_the_length_of_the_phase():
    options = config(steps=4000, phases=[Phase(until=0.1), Phase(until=1, pushforward=10)])
    drawn = [drawn_at(options, step) for step in range(4000)]
    assert drawn[:400] == list(range(400))
    assert drawn[400 : 400 + INTERLEAVED] == list(range(400, 400 + INTERLEAVED))
    assert all((step - first) % INTERLEAVED == 0 for step, first in enumerate(drawn))
    lengths = Counter(first for first in drawn[400:] if 400 + INTERLEAVED <= first < 3800)
    assert set(lengths.values()) == {11}
    ages = Counter(
        (step - first) // INTERLEAVED for step, first in enumerate(drawn) if 1000 <= step < 1000 + 11 * INTERLEAVED
    )
    assert set(ages) == set(range(11))
    assert set(ages.values()) == {INTERLEAVED}, "at any time there are rollouts of every age"


def test_a_rollout_continues_from_the_state_of_its_last_loss(tmp_path, data, two_interleaved):
    run = TrainingRun(config(steps=12, phases=[Phase(until=1, pushforward=2)]), tmp_path)
    with Batches(Windows(data), run) as batches:
        batch = batches.at(0)
        run.take_step(batch)
        assert batch.age == 1
        first = [state.positions.clone() for state in batch.states]
        assert not any(state.positions.requires_grad for state in batch.states)
        run.take_step(batches.at(1))
        again = batches.at(2)
        assert again is batch
        run.take_step(again)
        assert batch.age == 2
    displacements = [state.positions - before for state, before in zip(batch.states, first, strict=True)]
    assert all(0 < displacement.norm(dim=-1).max() < 0.1 for displacement in displacements)


@pytest.mark.parametrize("options", [config(steps=12, phases=LONG), message_passing("gns", steps=12, phases=LONG)])
@pytest.mark.parametrize("stopped", [7, 9])
def test_unfinished_rollouts_resume_bit_for_bit(tmp_path, data, two_interleaved, options, stopped):
    straight = TrainingRun(options, tmp_path / "straight")
    train(straight, Windows(data), data)
    halves = TrainingRun(options, tmp_path / "halves")
    train(halves, Windows(data), data, stop=lambda: halves.step == stopped)
    resumed = TrainingRun(options, tmp_path / "halves")
    resumed.resume()
    assert resumed.step == stopped and resumed.saved_states
    train(resumed, Windows(data), data)
    assert_same(resumed, straight)


def test_a_run_stopped_soon_after_resuming_keeps_the_states_of_all_rollouts(tmp_path, data, two_interleaved):
    options = config(steps=12, phases=LONG)
    straight = TrainingRun(options, tmp_path / "straight")
    train(straight, Windows(data), data)
    for stopped in (5, 6):  # the batch of step 6 was drawn at step 4
        halves = TrainingRun(options, tmp_path / "halves")
        if halves.files.exist():
            halves.resume()
        train(halves, Windows(data), data, stop=lambda run=halves, last=stopped: run.step == last)
    resumed = TrainingRun(options, tmp_path / "halves")
    resumed.resume()
    train(resumed, Windows(data), data)
    assert_same(resumed, straight)


def test_rollouts_without_saved_states_start_again(tmp_path, data, two_interleaved):
    options = config(steps=12, phases=LONG)
    with pytest.raises(Stop):
        train(TrainingRun(options, tmp_path), Windows(data), data, report=stop_at(7))
    resumed = TrainingRun(options, tmp_path)
    resumed.resume()
    resumed.saved_states = {}
    train(resumed, Windows(data), data)
    assert resumed.step == 12
    assert all(torch.isfinite(weight).all() for weight in resumed.model.parameters())


def test_the_saved_states_belong_to_the_main_process_alone(tmp_path, data, two_interleaved):
    options = config(steps=12, phases=LONG)
    with pytest.raises(Stop):
        train(TrainingRun(options, tmp_path), Windows(data), data, report=stop_at(7))
    for main in (True, False):
        resumed = TrainingRun(options, tmp_path)
        resumed.fabric = SimpleNamespace(is_global_zero=main, device=torch.device("cpu"))
        resumed.resume()
        assert bool(resumed.saved_states) == main
