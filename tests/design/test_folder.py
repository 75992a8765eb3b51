import csv
import json

import pytest

from surfsup.design.folder import resume
from surfsup.errors import InputError
from tests.design.test_run import move_water_left
from tests.design.test_task import ball_task, make_run, optimize_run


def test_a_resumed_run_equals_an_uninterrupted_one(tmp_path):
    task, options = ball_task(height=0.2, reward=move_water_left), {"iterations": 4, "smoothing": 0.003}
    uninterrupted = optimize_run(make_run(task, tmp_path / "a", **options))
    optimize_run(make_run(task, tmp_path / "b", **options), evaluations=2)
    resumed = make_run(task, tmp_path / "b", **options)
    resume(resumed)
    assert len(resumed.rewards) == 2
    optimize_run(resumed)
    assert resumed.rewards == uninterrupted.rewards
    assert resumed.designs == uninterrupted.designs
    assert resumed.simulations_at == uninterrupted.simulations_at and resumed.simulations == uninterrupted.simulations


def test_a_run_with_other_settings_is_not_resumed(tmp_path):
    task = ball_task(height=0.2, reward=move_water_left)
    optimize_run(make_run(task, tmp_path, iterations=4), evaluations=1)
    with pytest.raises(InputError, match="belongs to a design with other settings"):
        resume(make_run(task, tmp_path, iterations=5))


def test_a_damaged_checkpoint_is_refused(tmp_path):
    run = optimize_run(make_run(ball_task(height=0.2, reward=move_water_left), tmp_path, iterations=4), evaluations=1)
    run.files.last.write_bytes(b"nonsense")
    with pytest.raises(InputError, match="no checkpoint"):
        resume(make_run(run.task, tmp_path, iterations=4))


def test_rewards_and_designs_are_written(tmp_path):
    run = optimize_run(make_run(ball_task(height=0.2, reward=move_water_left), tmp_path, iterations=2))
    rows = list(csv.DictReader((tmp_path / "history.csv").open()))
    assert [float(row["reward"]) for row in rows] == pytest.approx(run.rewards, rel=1e-5)
    assert json.loads((tmp_path / "design.json").read_text())["designs"]["best"]["iteration"] == run.best
