from collections import Counter
from types import SimpleNamespace

import pytest
import torch

from surfsup.datasets.windows import Windows
from surfsup.training import batches as batches_module
from surfsup.training.batches import UNDER_WAY, Batches, beginning
from surfsup.training.config import Phase
from surfsup.training.step import take_step
from surfsup.training.train import Run, train
from tests.training.conftest import Stop, assert_same, config, message_passing, stop_at

LONG = [Phase(until=0.25), Phase(until=1, unseen=5, unroll=2, noise=1e-3)]  # rollouts of three losses each


@pytest.fixture
def two_under_way(monkeypatch):
    monkeypatch.setattr(batches_module, "UNDER_WAY", 2)


def test_where_nothing_goes_on_every_step_has_a_new_batch():
    of = config(steps=50, phases=[Phase(until=1, unseen=1, unroll=2)])
    assert [beginning(of, step) for step in range(50)] == list(range(50))


def test_a_rollout_goes_on_in_its_turn_until_it_is_as_long_as_the_phase_says():
    of = config(steps=4000, phases=[Phase(until=0.1), Phase(until=1, unseen=20, unroll=2)])
    begun = [beginning(of, step) for step in range(4000)]
    assert begun[:400] == list(range(400))
    assert begun[400 : 400 + UNDER_WAY] == list(range(400, 400 + UNDER_WAY))
    assert all((step - began) % UNDER_WAY == 0 for step, began in enumerate(begun))
    had = Counter(began for began in begun[400:] if 400 + UNDER_WAY <= began < 3800)
    assert set(had.values()) == {11}
    ages = Counter(
        (step - began) // UNDER_WAY for step, began in enumerate(begun) if 1000 <= step < 1000 + 11 * UNDER_WAY
    )
    assert set(ages) == set(range(11))
    assert set(ages.values()) == {UNDER_WAY}, "at any time there are rollouts of every age"


def test_a_loss_begins_where_the_one_before_has_led(tmp_path, data, two_under_way):
    run = Run(config(steps=12, phases=[Phase(until=1, unseen=4, unroll=2)]), tmp_path)
    with Batches(Windows(data), run) as batches:
        batch = batches.of(0)
        take_step(run, batch)
        assert batch.done == 2
        first = [state.positions.clone() for state in batch.states]
        assert not any(state.positions.requires_grad for state in batch.states)
        take_step(run, batches.of(1))
        again = batches.of(2)
        assert again is batch
        take_step(run, again)
        assert batch.done == 4
    moves = [state.positions - before for state, before in zip(batch.states, first, strict=True)]
    assert all(0 < move.norm(dim=-1).max() < 0.1 for move in moves)


@pytest.mark.parametrize("of", [config(steps=12, phases=LONG), message_passing("gns", steps=12, phases=LONG)])
@pytest.mark.parametrize("stopped", [7, 9])
def test_rollouts_under_way_go_on_bit_for_bit_after_a_stop(tmp_path, data, two_under_way, of, stopped):
    straight = Run(of, tmp_path / "straight")
    train(straight, Windows(data), data)
    halves = Run(of, tmp_path / "halves")
    train(halves, Windows(data), data, stop=lambda: halves.step == stopped)
    resumed = Run(of, tmp_path / "halves")
    resumed.resume()
    assert resumed.step == stopped and resumed.stood
    train(resumed, Windows(data), data)
    assert_same(resumed, straight)


def test_a_run_that_is_stopped_again_at_once_still_knows_how_all_rollouts_stood(tmp_path, data, two_under_way):
    of = config(steps=12, phases=LONG)
    straight = Run(of, tmp_path / "straight")
    train(straight, Windows(data), data)
    for stopped in (5, 6):  # the batch of step 6 began at 4
        halves = Run(of, tmp_path / "halves")
        if halves.files.exist():
            halves.resume()
        train(halves, Windows(data), data, stop=lambda run=halves, last=stopped: run.step == last)
    resumed = Run(of, tmp_path / "halves")
    resumed.resume()
    train(resumed, Windows(data), data)
    assert_same(resumed, straight)


def test_where_it_is_not_known_how_rollouts_stood_they_begin_anew(tmp_path, data, two_under_way):
    of = config(steps=12, phases=LONG)
    with pytest.raises(Stop):
        train(Run(of, tmp_path), Windows(data), data, report=stop_at(7))
    resumed = Run(of, tmp_path)
    resumed.resume()
    resumed.stood = {}
    train(resumed, Windows(data), data)
    assert resumed.step == 12
    assert all(torch.isfinite(weight).all() for weight in resumed.model.parameters())


def test_what_the_first_process_saved_of_its_rollouts_is_no_other_s(tmp_path, data, two_under_way):
    of = config(steps=12, phases=LONG)
    with pytest.raises(Stop):
        train(Run(of, tmp_path), Windows(data), data, report=stop_at(7))
    for first in (True, False):
        resumed = Run(of, tmp_path)
        resumed.fabric = SimpleNamespace(is_global_zero=first, device=torch.device("cpu"))
        resumed.resume()
        assert bool(resumed.stood) == first
