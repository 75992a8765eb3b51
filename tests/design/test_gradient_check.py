"""The rewards here are functions of the parameter vector, so their true gradients are known."""

import numpy as np
import pytest
import torch

from surfsup.design.gradient_check import GradientCheck
from surfsup.design.optimizer import Optimizer
from surfsup.design.parameter import Parameter

START = {"x": torch.tensor([0.5, 0.5])}


def make_optimizer(**more) -> Optimizer:
    return Optimizer({"x": Parameter(START["x"], **{"lower": 0.0, "upper": 1.0, "step": 0.1, **more})}, START, 50)


def hill(vector: torch.Tensor) -> float:
    return -float((vector - torch.tensor([4.0, 5.5])).square().sum())


def measure(check: GradientCheck, optimizer: Optimizer, gradient: torch.Tensor, score=hill):
    return check.measure(optimizer, gradient, score(optimizer.vector), score, np.random.default_rng(0))


class TestPredictedImprovement:
    def test_of_a_true_gradient_is_reliable(self):
        optimizer, check = make_optimizer(), GradientCheck()
        for _ in range(4):
            distance = optimizer.vector - torch.tensor([0.0, 9.0])
            gradient = -2 * distance
            assert check.compare(optimizer, gradient, -float(distance.square().sum()), 0.0)
            optimizer.step(gradient)
        assert not check.unreliable

    def test_that_fails_twice_in_a_row_is_unreliable(self):
        optimizer, check = make_optimizer(), GradientCheck()
        uphill = torch.tensor([1.0, 1.0])
        unreliable = []
        for reward in (0.0, -1.0, -2.0):
            check.compare(optimizer, uphill, reward, 0.0)
            unreliable.append(check.unreliable)
            optimizer.step(uphill)
        assert unreliable == [False, False, True]

    def test_does_not_fail_by_less_than_a_fraction_of_the_total_gain(self):
        optimizer, check = make_optimizer(), GradientCheck()
        assert check.compare(optimizer, torch.tensor([0.1, 0.1]), 0.0, 100.0)
        optimizer.step(torch.tensor([0.1, 0.1]))
        assert check.compare(optimizer, torch.tensor([0.1, 0.1]), -0.2, 100.0)

    def test_outside_the_bounds_is_unreliable(self):
        optimizer, check = make_optimizer(upper=0.5), GradientCheck()
        check.compare(optimizer, torch.tensor([1.0, 1.0]), 0.0, 0.0)
        assert check.unreliable

    def test_that_is_much_smaller_than_usual_is_unreliable(self):
        optimizer, check = make_optimizer(), GradientCheck()
        optimizer.step(torch.tensor([1.0, 1.0]))
        check.compare(optimizer, torch.tensor([1e-3, 1e-3]), 0.0, 0.0)
        assert check.unreliable


class TestFiniteDifferences:
    def test_give_the_whole_gradient_of_two_parameters(self):
        found = measure(GradientCheck(), make_optimizer(), torch.tensor([3.0, -7.0]))
        assert found.gradient.tolist() == pytest.approx([-2.0, 1.0], abs=1e-4)

    def test_find_the_maximum_of_a_quadratic_nearby(self):
        found = measure(
            GradientCheck(),
            make_optimizer(),
            torch.tensor([-2.0, 1.0]),
            lambda vector: hill(vector + torch.tensor([-0.7, 0])),
        )
        assert (5.0 + found.step_to_maximum).tolist() == pytest.approx([4.7, 5.5], abs=1e-4)

    def test_find_no_maximum_where_the_reward_is_convex(self):
        optimizer, gradient = make_optimizer(), torch.tensor([1.0, 1.0])
        assert measure(GradientCheck(), optimizer, gradient, lambda vector: -hill(vector)).step_to_maximum is None

    def test_confirm_a_true_gradient(self):
        for gradient, unreliable in (([-2.0, 1.0], False), ([2.0, -1.0], True)):
            check = GradientCheck()
            check.unreliable = True
            measure(check, make_optimizer(), torch.tensor(gradient))
            assert check.unreliable == unreliable

    def test_reach_further_each_time_that_the_optimizer_stalls(self):
        def local_maximum(vector):
            return float((vector - 5).abs().max().clamp(min=1.5) - 3 * ((vector - 5).abs().max() < 1.5))

        optimizer, check, samples = make_optimizer(), GradientCheck(), []
        for _ in range(4):
            optimizer.step(torch.zeros(2))  # a step of length zero
            measure(
                check,
                optimizer,
                torch.tensor([1.0, 0.0]),
                lambda vector: samples.append(vector) or local_maximum(vector),
            )
        distances = [float((vector - 5).abs().max()) for vector in samples]
        assert distances[0] == 0 and max(distances) == pytest.approx(4.0, abs=1e-4)
        assert check.stalls == 4
        optimizer.step(torch.tensor([1.0, 0.0]))
        measure(check, optimizer, torch.tensor([1.0, 0.0]))
        assert check.stalls == 0

    def test_are_one_sided_at_a_bound(self):
        optimizer = make_optimizer(upper=0.5)
        found = measure(GradientCheck(), optimizer, torch.tensor([1.0, 1.0]), lambda vector: float(2 * vector.sum()))
        assert found.gradient.tolist() == pytest.approx([2.0, 2.0], abs=1e-4)

    def test_are_one_sided_where_the_reward_is_undefined(self):
        def score(vector):
            return None if vector[0] > 5.01 or vector[1] < 4.99 else hill(vector)

        found = measure(GradientCheck(), make_optimizer(), torch.tensor([1.0, 1.0]), score).gradient
        assert bool(torch.isfinite(found).all())

    def test_improve_a_gradient_of_many_parameters(self):
        start = {"x": torch.full((9,), 0.5)}
        optimizer = Optimizer({"x": Parameter(start["x"], 0.0, 1.0, 0.1)}, start, 50)
        true = torch.arange(9.0)
        gradient = true + torch.randn(9, generator=torch.Generator().manual_seed(0))
        found = measure(GradientCheck(), optimizer, gradient, lambda vector: float(true @ vector)).gradient
        assert float((found - true).norm()) < float((gradient - true).norm())
