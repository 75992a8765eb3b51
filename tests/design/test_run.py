import csv
import json

import pytest
import torch

from surfsup.design.ascent import LONGEST, Ascent
from surfsup.design.parameter import Parameter
from surfsup.errors import InputError
from tests.design.test_task import ball_task, climb, run_of


def away(end):
    """A reward that grows as the water leaves to one side."""
    return -end.positions[:, 0].mean()


class TestARun:
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


class TestTheAscent:
    def ascent(self, start=0.5, iterations=50, **more) -> Ascent:
        parameter = Parameter(start, **{"lower": 0.0, "upper": 1.0, "step": 0.05, **more})
        return Ascent({"x": parameter}, {"x": torch.tensor(start)}, iterations)

    def test_finds_the_top_of_a_hill_of_any_height(self):
        for height in (1e-6, 1.0, 1e6):
            ascent = self.ascent()
            for _ in range(50):
                ascent.take({"x": -2 * height * (ascent.values["x"].detach() - 0.3)})
            assert float(ascent.values["x"].detach()) == pytest.approx(0.3, abs=0.01)

    def test_stays_in_the_range(self):
        ascent = self.ascent()
        for _ in range(50):
            ascent.take({"x": torch.tensor(1.0)})
            assert 0 <= float(ascent.values["x"].detach()) <= 1

    def test_a_value_to_keep_is_kept(self):
        ascent = self.ascent(start=0.02, keeps=0.0)
        ascent.take({"x": torch.tensor(-1.0)})
        assert float(ascent.values["x"].detach()) == 0
        for _ in range(9):
            ascent.take({"x": torch.tensor(1.0)})
        assert float(ascent.values["x"].detach()) == 0

    def test_a_long_gradient_is_cut_and_counted(self):
        ascent = self.ascent()
        for _ in range(10):
            ascent.take({"x": torch.tensor(1.0)})
        assert ascent.cut == 0
        ascent.take({"x": torch.tensor(1e9)})
        assert ascent.cut == 1
        assert float(ascent.mean["x"]) <= 0.05 * LONGEST

    @pytest.mark.parametrize("value", [float("nan"), float("inf")])
    def test_one_that_is_not_finite_is_left_out_and_counted(self, value):
        ascent = self.ascent()
        ascent.take({"x": torch.tensor(value)})
        assert ascent.cut == 1 and float(ascent.values["x"].detach()) == 0.5

    def test_offers_a_remedy_when_that_happens_often(self, simulator, tmp_path):
        run = climb(run_of(ball_task(height=0.17, reward=away), simulator, tmp_path, iterations=2))
        assert run.remedy() is None
        run.ascent.cut = 2
        assert "fewer --frames" in run.remedy() and "--smooth" in run.remedy()
