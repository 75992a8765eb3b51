"""Rewards here are functions of a place: what is known of them exactly, the trust must find out."""

import numpy as np
import pytest
import torch

from surfsup.design.ascent import Ascent
from surfsup.design.parameter import Parameter
from surfsup.design.trust import Trust

START = {"x": torch.tensor([0.5, 0.5])}


def ascent(**more) -> Ascent:
    return Ascent({"x": Parameter(START["x"], **{"lower": 0.0, "upper": 1.0, "step": 0.1, **more})}, START, 50)


def hill(place: torch.Tensor) -> float:
    return -float((place - torch.tensor([4.0, 5.5])).square().sum())


def measured(trust: Trust, one: Ascent, slope: torch.Tensor, score=hill):
    return trust.measured(one, slope, score(one.place), score, np.random.default_rng(0))


class TestAPromise:
    def test_is_kept_by_the_gradient_of_a_hill(self):
        one, trust = ascent(), Trust()
        for _ in range(4):
            slope = -2 * (one.place - torch.tensor([0.0, 9.0]))
            assert trust.weigh(one, slope, -float((one.place - torch.tensor([0.0, 9.0])).square().sum()), 0.0)
            one.take(slope)
        assert not trust.doubted

    def test_broken_twice_in_a_row_is_doubted(self):
        one, trust = ascent(), Trust()
        uphill = torch.tensor([1.0, 1.0])
        doubts = []
        for reward in (0.0, -1.0, -2.0):
            trust.weigh(one, uphill, reward, 0.0)
            doubts.append(trust.doubted)
            one.take(uphill)
        assert doubts == [False, False, True]

    def test_of_less_than_is_at_stake_is_not_broken(self):
        one, trust = ascent(), Trust()
        assert trust.weigh(one, torch.tensor([0.1, 0.1]), 0.0, 100.0)
        one.take(torch.tensor([0.1, 0.1]))
        assert trust.weigh(one, torch.tensor([0.1, 0.1]), -0.2, 100.0)

    def test_that_the_ranges_bar_is_doubted(self):
        one, trust = ascent(upper=0.5), Trust()
        trust.weigh(one, torch.tensor([1.0, 1.0]), 0.0, 0.0)
        assert trust.doubted

    def test_of_hardly_anything_is_doubted(self):
        one, trust = ascent(), Trust()
        one.take(torch.tensor([1.0, 1.0]))
        trust.weigh(one, torch.tensor([1e-3, 1e-3]), 0.0, 0.0)
        assert trust.doubted


class TestMeasuredSlopes:
    def test_of_two_parameters_are_those_of_the_reward_whatever_the_gradient_said(self):
        found = measured(Trust(), ascent(), torch.tensor([3.0, -7.0]))
        assert found.slope.tolist() == pytest.approx([-2.0, 1.0], abs=1e-4)

    def test_leap_to_the_top_of_a_parabola_nearby(self):
        found = measured(
            Trust(), ascent(), torch.tensor([-2.0, 1.0]), lambda place: hill(place + torch.tensor([-0.7, 0]))
        )
        assert (5.0 + found.leap).tolist() == pytest.approx([4.7, 5.5], abs=1e-4)

    def test_leap_nowhere_where_the_reward_bends_up(self):
        assert measured(Trust(), ascent(), torch.tensor([1.0, 1.0]), lambda place: -hill(place)).leap is None

    def test_end_the_doubt_where_the_gradient_was_right(self):
        for slope, doubted in (([-2.0, 1.0], False), ([2.0, -1.0], True)):
            trust = Trust()
            trust.doubted = True
            measured(trust, ascent(), torch.tensor(slope))
            assert trust.doubted == doubted

    def test_are_looked_for_ever_farther_off_where_the_climb_stands_still(self):
        def trap(place):
            return float((place - 5).abs().max().clamp(min=1.5) - 3 * ((place - 5).abs().max() < 1.5))

        one, trust, asked = ascent(), Trust(), []
        for _ in range(4):
            one.take(torch.zeros(2))  # it does not move
            measured(trust, one, torch.tensor([1.0, 0.0]), lambda place: asked.append(place) or trap(place))
        reached = [float((place - 5).abs().max()) for place in asked]
        assert reached[0] == 0 and max(reached) == pytest.approx(4.0, abs=1e-4)
        assert trust.still == 4
        one.take(torch.tensor([1.0, 0.0]))
        measured(trust, one, torch.tensor([1.0, 0.0]))
        assert trust.still == 0

    def test_go_as_far_as_the_ranges_do(self):
        found = measured(Trust(), ascent(upper=0.5), torch.tensor([1.0, 1.0]), lambda place: float(2 * place.sum()))
        assert found.slope.tolist() == pytest.approx([2.0, 2.0], abs=1e-4)

    def test_take_no_side_that_has_no_reward(self):
        def score(place):
            return None if place[0] > 5.01 or place[1] < 4.99 else hill(place)

        found = measured(Trust(), ascent(), torch.tensor([1.0, 1.0]), score).slope
        assert bool(torch.isfinite(found).all())

    def test_leave_what_they_do_not_reach(self):
        start = {"x": torch.full((9,), 0.5)}
        one = Ascent({"x": Parameter(start["x"], 0.0, 1.0, 0.1)}, start, 50)
        true = torch.arange(9.0)
        slope = true + torch.randn(9, generator=torch.Generator().manual_seed(0))
        found = measured(Trust(), one, slope, lambda place: float(true @ place)).slope
        assert float((found - true).norm()) < float((slope - true).norm())
