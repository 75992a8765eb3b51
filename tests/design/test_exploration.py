import pytest
import torch

from surfsup.design.exploration import EXPLORED, PATIENCE, REACH, explore, is_due
from surfsup.design.optimizer import Optimizer
from surfsup.design.parameter import Parameter
from surfsup.design.parameter_space import ParameterSpace
from tests.design.test_run import move_water_left
from tests.design.test_task import ball_task, make_run

RADII = {
    "r1": Parameter(0.1, lower=0.1, upper=0.25, step=0.02),
    "r2": Parameter(0.09, lower=0.065, upper=lambda values: 0.95 * values["r1"], step=0.02),
}
START = {"r1": torch.tensor(0.1), "r2": torch.tensor(0.09)}
SPACE = ParameterSpace(RADII, START)


def test_it_is_due_each_time_that_some_designs_improved_nothing():
    rewards = [0.0, 1.0]
    due = []
    for number in range(1, 2 * PATIENCE + 2):
        rewards.append(0.5)
        due.append((number, is_due(rewards)))
    assert [number for number, yes in due if yes] == [PATIENCE, 2 * PATIENCE]
    assert not is_due([0.0])
    assert not is_due([0.0, 1.0])


def test_it_finds_what_lies_beyond_a_fall_of_the_reward():
    def score(vector):
        r1 = float(SPACE.to_values(vector)["r1"])
        return -abs(r1 - 0.22) if r1 > 0.15 else 0.1 - r1 - 0.1  # falls from the start, rises beyond 0.15

    seen = []
    vector, reward = explore(SPACE, SPACE.to_vector(START), lambda point: seen.append(point) or score(point), [0, 1])
    values = SPACE.to_values(vector)
    assert float(values["r1"]) == pytest.approx(0.22, abs=0.02)
    assert reward == score(vector)
    assert len(seen) == EXPLORED
    radii = torch.stack([torch.stack(list(SPACE.to_values(point).values())) for point in seen])
    assert float(radii[:, 0].min()) < 0.12 and float(radii[:, 0].max()) > 0.23
    assert bool((radii[:, 1] <= 0.95 * radii[:, 0] + 1e-6).all())


def test_the_points_depend_on_the_seed_alone():
    points = [[], [], []]
    for number, seed in enumerate(([0, 1], [0, 1], [0, 2])):
        explore(SPACE, SPACE.to_vector(START), lambda point, of=points[number]: of.append(point), seed)
    assert torch.equal(torch.stack(points[0]), torch.stack(points[1]))
    assert not torch.equal(torch.stack(points[0]), torch.stack(points[2]))


def test_an_unbounded_parameter_is_explored_around_the_best_design():
    space = ParameterSpace({"x": Parameter(3.0, -1e30, 1e30, step=0.5)}, {"x": torch.tensor(3.0)})
    seen = []
    explore(space, torch.tensor([6.0]), lambda point: seen.append(float(point)), [0])
    assert 6 - REACH <= min(seen) < 2 and 10 < max(seen) <= 6 + REACH


def test_without_a_defined_reward_nothing_is_found():
    assert explore(SPACE, SPACE.to_vector(START), lambda point: None, [0]) is None


def test_the_optimizer_continues_from_the_design_it_jumps_to():
    optimizer = Optimizer(RADII, START, 50)
    optimizer.step(torch.tensor([1.0, 1.0]))
    square = optimizer.state["square"].clone()
    optimizer.jump_to(torch.tensor([10.0, 4.0]))
    assert [round(float(value.detach()), 6) for value in optimizer.values.values()] == [0.2, 0.08]
    assert all(value.requires_grad for value in optimizer.values.values())
    assert torch.equal(optimizer.state["square"], square)
    assert all(not bool(optimizer.state[name].any()) for name in ("mean", "weight", "gradient", "step"))


def test_a_run_jumps_only_to_a_better_design(tmp_path):
    run = make_run(ball_task(height=0.2, reward=move_water_left), tmp_path, iterations=4)
    run.iterate()
    stayed = run.optimizer.vector.clone()
    run.explore(lambda vector: run.rewards[0] - 1)
    assert torch.equal(run.optimizer.vector, stayed)
    seen = []
    run.explore(lambda vector: seen.append(vector) or run.rewards[0] + len(seen))
    assert torch.allclose(run.optimizer.vector, seen[-1], atol=1e-5)
    assert run.gradient_check.previous == {}
