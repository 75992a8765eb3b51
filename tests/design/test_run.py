import torch

from surfsup.design.history import PATIENCE
from tests.design.test_rollout import Unfollowable
from tests.design.test_task import ball_task, make_run, optimize_run


def move_water_left(end):
    """A reward that increases as the water moves to one side."""
    return -end.positions[:, 0].mean()


def test_a_run_ends_when_it_has_converged(tmp_path):
    run = make_run(ball_task(height=0.2, reward=move_water_left), tmp_path)
    run.rewards = [0.0, 0.5, 1.0]
    assert not run.converged
    run.rewards += [0.9] * (PATIENCE - 1)
    assert not run.done
    run.rewards.append(1.0001)
    assert run.converged and run.done
    run.rewards[-1] = 1.1
    assert not run.converged


def test_a_run_improves_the_reward(tmp_path):
    run = optimize_run(make_run(ball_task(height=0.2, reward=move_water_left), tmp_path, iterations=4))
    assert run.done and len(run.rewards) == 5
    assert run.rewards[-1] > run.rewards[0] and run.best > 0


def test_a_remedy_is_suggested_if_gradients_are_clipped_often(tmp_path):
    run = optimize_run(make_run(ball_task(height=0.2, reward=move_water_left), tmp_path, iterations=2))
    assert run.remedy() is None
    run.optimizer.clipped = 2
    assert "fewer --frames" in run.remedy() and "--smooth" in run.remedy()


def test_a_step_is_skipped_whose_gradient_is_not_finite(tmp_path):
    run = make_run(ball_task(height=0.2, reward=move_water_left), tmp_path, iterations=2)
    start = run.task.initial_state()
    run.simulator = Unfollowable(float(start.positions[0, 2]) - 1e-6)
    before = run.optimizer.vector.clone()
    run.iterate()
    assert torch.equal(run.optimizer.vector, before) and run.optimizer.clipped == 1
    assert "1 of 1 steps were skipped: the gradient is not finite: it cannot be followed back through" in run.remedy()
