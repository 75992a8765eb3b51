import csv
import json

import pytest

from surfsup.design.folder import resume
from surfsup.errors import InputError
from tests.design.test_run import away
from tests.design.test_task import ball_task, climb, run_of


class TestTheFolderOfARun:
    def test_stopped_and_resumed_is_the_same_run(self, simulator, tmp_path):
        task, more = ball_task(height=0.2, reward=away), {"iterations": 4, "smoothing": 0.003}
        through = climb(run_of(task, simulator, tmp_path / "a", **more))
        climb(run_of(task, simulator, tmp_path / "b", **more), most=2)
        resumed = run_of(task, simulator, tmp_path / "b", **more)
        resume(resumed)
        assert len(resumed.rewards) == 2
        climb(resumed)
        assert resumed.rewards == through.rewards
        assert resumed.designs == through.designs
        assert resumed.found_after == through.found_after and resumed.simulations == through.simulations

    def test_does_not_go_on_as_another_design(self, simulator, tmp_path):
        task = ball_task(height=0.2, reward=away)
        climb(run_of(task, simulator, tmp_path, iterations=4), most=1)
        with pytest.raises(InputError, match="belongs to a design with other settings"):
            resume(run_of(task, simulator, tmp_path, iterations=5))

    def test_of_a_damaged_checkpoint_tells_so(self, simulator, tmp_path):
        run = climb(run_of(ball_task(height=0.2, reward=away), simulator, tmp_path, iterations=4), most=1)
        run.files.last.write_bytes(b"nonsense")
        with pytest.raises(InputError, match="no checkpoint"):
            resume(run_of(run.task, simulator, tmp_path, iterations=4))

    def test_writes_what_it_found(self, simulator, tmp_path):
        run = climb(run_of(ball_task(height=0.2, reward=away), simulator, tmp_path, iterations=2))
        rows = list(csv.DictReader((tmp_path / "history.csv").open()))
        assert [float(row["reward"]) for row in rows] == pytest.approx(run.rewards, rel=1e-5)
        assert json.loads((tmp_path / "design.json").read_text())["designs"]["best"]["iteration"] == run.best
