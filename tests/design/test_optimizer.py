import pytest
import torch

from surfsup.design.optimizer import CLIP_RATIO, Optimizer
from surfsup.design.parameter import Parameter


def make_optimizer(start=0.5, iterations=50, **more) -> Optimizer:
    parameter = Parameter(start, **{"lower": 0.0, "upper": 1.0, "step": 0.05, **more})
    return Optimizer({"x": parameter}, {"x": torch.tensor(start)}, iterations)


def x_of(optimizer: Optimizer) -> float:
    return float(optimizer.values["x"].detach())


def gradient(*values: float) -> torch.Tensor:
    """In reward per step length."""
    return torch.tensor(values)


def test_it_finds_the_maximum_of_a_reward_of_any_scale():
    for scale in (1e-6, 1.0, 1e6):
        optimizer = make_optimizer()
        for _ in range(50):
            optimizer.step(gradient(-2 * scale * (x_of(optimizer) - 0.3)))
        assert x_of(optimizer) == pytest.approx(0.3, abs=0.01)


def test_it_takes_secant_steps_if_gradients_are_reliable():
    for reliable, tolerance in ((True, 1e-3), (False, 0.02)):
        optimizer = make_optimizer(start=0.08)
        errors = []
        for _ in range(9):
            optimizer.step(gradient(0.3 - x_of(optimizer)), reliable)
            errors.append(abs(x_of(optimizer) - 0.3))
        assert (min(errors[-3:]) < tolerance) == reliable


def test_it_takes_a_known_step():
    optimizer = make_optimizer()
    optimizer.step(gradient(1.0), known_step=gradient(-2.0))
    assert x_of(optimizer) == pytest.approx(0.5 - 2 * 0.05)


def test_values_stay_within_their_bounds():
    optimizer = make_optimizer()
    for _ in range(50):
        optimizer.step(gradient(1.0))
        assert 0 <= x_of(optimizer) <= 1


def test_a_value_stays_where_it_is_frozen():
    optimizer = make_optimizer(start=0.02, freeze_at=0.0)
    optimizer.step(gradient(-1.0))
    assert x_of(optimizer) == 0 and not optimizer.free.any()
    for _ in range(9):
        optimizer.step(gradient(1.0))
    assert x_of(optimizer) == 0


def test_a_value_freezes_within_the_tolerance():
    optimizer = make_optimizer(start=0.06, freeze_at=0.0, freeze_tolerance=0.015)
    optimizer.step(gradient(-1.0))
    assert x_of(optimizer) == 0


def test_a_long_gradient_is_clipped_and_counted():
    optimizer = make_optimizer()
    for _ in range(10):
        optimizer.step(gradient(1.0))
    assert optimizer.clipped == 0
    optimizer.step(gradient(1e9))
    assert optimizer.clipped == 1
    assert float(optimizer.state["gradient"]) <= CLIP_RATIO


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_gradient_that_is_not_finite_is_skipped_and_counted(value):
    optimizer = make_optimizer()
    optimizer.step(gradient(value))
    assert optimizer.clipped == 1 and x_of(optimizer) == 0.5
