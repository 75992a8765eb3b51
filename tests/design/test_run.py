import csv
import json

import pytest
import torch

from surfsup.design.ascent import LONGEST, Ascent
from surfsup.design.parameter import Parameter
from surfsup.design.run import PATIENCE
from surfsup.errors import InputError
from tests.design.test_task import ball_task, climb, run_of


def away(end):
    """A reward that grows as the water leaves to one side."""
    return -end.positions[:, 0].mean()


class TestARun:
    def test_ends_when_nothing_is_gained_any_more(self, simulator, tmp_path):
        run = run_of(ball_task(height=0.17, reward=away), simulator, tmp_path)
        run.rewards = [0.0, 0.5, 1.0]
        assert not run.settled
        run.rewards += [0.9] * (PATIENCE - 1)
        assert not run.done
        run.rewards.append(1.0001)
        assert run.settled and run.done
        run.rewards[-1] = 1.1
        assert not run.settled

    def test_climbs(self, simulator, tmp_path):
        run = climb(run_of(ball_task(height=0.17, reward=away), simulator, tmp_path, iterations=4))
        assert run.done and len(run.rewards) == 5
        assert run.rewards[-1] > run.rewards[0] and run.best > 0

    def test_stopped_and_resumed_is_the_same_run(self, simulator, tmp_path):
        task, more = ball_task(height=0.17, reward=away), {"iterations": 4, "smoothing": 0.003}
        through = climb(run_of(task, simulator, tmp_path / "a", **more))
        climb(run_of(task, simulator, tmp_path / "b", **more), most=2)
        resumed = run_of(task, simulator, tmp_path / "b", **more)
        resumed.resume()
        assert len(resumed.rewards) == 2
        climb(resumed)
        assert resumed.rewards == through.rewards
        assert resumed.designs == through.designs
        assert resumed.found_after == through.found_after and resumed.simulations == through.simulations

    def test_does_not_go_on_as_another_design(self, simulator, tmp_path):
        task = ball_task(height=0.17, reward=away)
        climb(run_of(task, simulator, tmp_path, iterations=4), most=1)
        with pytest.raises(InputError, match="belongs to a design with other settings"):
            run_of(task, simulator, tmp_path, iterations=5).resume()

    def test_of_a_damaged_checkpoint_tells_so(self, simulator, tmp_path):
        run = climb(run_of(ball_task(height=0.17, reward=away), simulator, tmp_path, iterations=4), most=1)
        run.files.last.write_bytes(b"nonsense")
        with pytest.raises(InputError, match="no checkpoint"):
            run_of(run.task, simulator, tmp_path, iterations=4).resume()

    def test_writes_what_it_found(self, simulator, tmp_path):
        run = climb(run_of(ball_task(height=0.17, reward=away), simulator, tmp_path, iterations=2))
        rows = list(csv.DictReader((tmp_path / "history.csv").open()))
        assert [float(row["reward"]) for row in rows] == pytest.approx(run.rewards, rel=1e-5)
        assert json.loads((tmp_path / "design.json").read_text())["designs"]["best"]["iteration"] == run.best


def ascent(start=0.5, iterations=50, **more) -> Ascent:
    parameter = Parameter(start, **{"lower": 0.0, "upper": 1.0, "step": 0.05, **more})
    return Ascent({"x": parameter}, {"x": torch.tensor(start)}, iterations)


def x_of(one: Ascent) -> float:
    return float(one.values["x"].detach())


def slope(*values: float) -> torch.Tensor:
    """In reward a step."""
    return torch.tensor(values)


class TestTheAscent:
    def test_finds_the_top_of_a_hill_of_any_height(self):
        for height in (1e-6, 1.0, 1e6):
            one = ascent()
            for _ in range(50):
                one.take(slope(-2 * height * (x_of(one) - 0.3)))
            assert x_of(one) == pytest.approx(0.3, abs=0.01)

    def test_lands_on_a_top_where_slopes_are_reliable(self):
        for reliable, off in ((True, 1e-3), (False, 0.02)):
            one = ascent(start=0.08)
            ways = []
            for _ in range(9):
                one.take(slope(0.3 - x_of(one)), reliable)
                ways.append(abs(x_of(one) - 0.3))
            assert (min(ways[-3:]) < off) == reliable

    def test_goes_where_it_is_told(self):
        one = ascent()
        one.take(slope(1.0), leap=slope(-2.0))
        assert x_of(one) == pytest.approx(0.5 - 2 * 0.05)

    def test_stays_in_the_range(self):
        one = ascent()
        for _ in range(50):
            one.take(slope(1.0))
            assert 0 <= x_of(one) <= 1

    def test_a_value_to_keep_is_kept(self):
        one = ascent(start=0.02, keeps=0.0)
        one.take(slope(-1.0))
        assert x_of(one) == 0 and not one.free.any()
        for _ in range(9):
            one.take(slope(1.0))
        assert x_of(one) == 0

    def test_near_to_it_counts_as_reached(self):
        one = ascent(start=0.06, keeps=0.0, reach=0.015)
        one.take(slope(-1.0))
        assert x_of(one) == 0

    def test_a_long_gradient_is_cut_and_counted(self):
        one = ascent()
        for _ in range(10):
            one.take(slope(1.0))
        assert one.cut == 0
        one.take(slope(1e9))
        assert one.cut == 1
        assert float(one.memory["slope"]) <= LONGEST

    @pytest.mark.parametrize("value", [float("nan"), float("inf")])
    def test_one_that_is_not_finite_is_left_out_and_counted(self, value):
        one = ascent()
        one.take(slope(value))
        assert one.cut == 1 and x_of(one) == 0.5

    def test_offers_a_remedy_when_that_happens_often(self, simulator, tmp_path):
        run = climb(run_of(ball_task(height=0.17, reward=away), simulator, tmp_path, iterations=2))
        assert run.remedy() is None
        run.ascent.cut = 2
        assert "fewer --frames" in run.remedy() and "--smooth" in run.remedy()
